// The map: a camera over the world, and everything that is drawn there.

const TRAIL_SECONDS = 10;
const TRAIL_STEPS = 14;
const CROWD = 12;

const font = (size, weight) => `${weight} ${size}px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif`;

class Camera {
  constructor() {
    Object.assign(this, { x: 0, y: 0, scale: 50, width: 1, height: 1 });
  }

  toScreen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toWorld(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    this.scale = Math.min(Math.max(this.scale * factor, 0.5), 2000);
    const [x1, y1] = this.toWorld(px, py);
    this.x += x - x1;
    this.y += y - y1;
  }

  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }
}

class MapView {
  constructor(canvas, trial) {
    this.canvas = canvas;
    this.trial = trial;
    this.context = canvas.getContext("2d");
    this.camera = new Camera();
    this.colours = {};
    this.covered = { right: 0, high: 0 };
    this.layer = { canvas: document.createElement("canvas"), key: "", last: "" };
    this.roads = new Path2D();
    addLines(this.roads, trial.lines);
    this.centres = new Path2D();
    addLines(this.centres, trial.centres);
    this.hints = new Path2D();
    for (const [x0, y0, x1, y1, x2, y2] of trial.hints) {
      this.hints.moveTo(x0, y0);
      this.hints.lineTo(x1, y1);
      this.hints.lineTo(x2, y2);
    }
  }

  recolour() {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ground", "road", "kerb", "line", "hint", "ink", "faint", "halo", "edge",
      "goal", "goal-ink", "contact", "breach", "others", "obstacle", "accent"]) {
      this.colours[name] = style.getPropertyValue(`--${name}`).trim();
    }
  }

  resize() {
    const { width, height } = this.canvas.getBoundingClientRect();
    this.ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.max(1, Math.round(width * this.ratio));
    this.canvas.height = Math.max(1, Math.round(height * this.ratio));
    Object.assign(this.camera, { width, height });
  }

  // Show all roads, goals and starts, and leave the given strips of the canvas to the controls on it.
  fit({ above, right: beside, below }) {
    const { trial, camera } = this;
    const margin = trial.width / 2 + 0.3;
    const xs = trial.lines.flatMap(([x0, , x1]) => [x0, x1]);
    const ys = trial.lines.flatMap(([, y0, , y1]) => [y0, y1]);
    for (let car = 0; car < trial.cars.length; car += 1) {
      const pose = trial.pose(car, trial.start);
      xs.push(pose.x);
      ys.push(pose.y);
    }
    const beyond = Math.max(0, trial.goals.radius - margin + 0.1);
    for (const vertex of trial.goals.vertices) {
      const [x, y] = trial.points[vertex];
      xs.push(x - beyond, x + beyond);
      ys.push(y - beyond, y + beyond);
    }
    const span = (values) => values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
    const [left, right] = span(xs);
    const [bottom, top] = span(ys);
    const wide = Math.max(camera.width - beside - 16, 0.5 * camera.width);
    const high = Math.max(camera.height - above - below, 0.4 * camera.height);
    camera.scale = Math.min(wide / (right - left + 2 * margin), high / (top - bottom + 2 * margin));
    camera.x = (left + right) / 2 + beside / 2 / camera.scale;
    camera.y = (bottom + top) / 2 + (above - below) / 2 / camera.scale;
  }

  // Whether a point of the world is well within the canvas.
  holds(x, y) {
    const [px, py] = this.camera.toScreen(x, y);
    return px > 10 && py > 10 && px < this.camera.width - 10 && py < this.camera.height - 10;
  }

  // The car under a point of the screen, or -1.
  carAt(px, py, time) {
    const [x, y] = this.camera.toWorld(px, py);
    const near = Math.max(this.trial.reach, 12 / this.camera.scale);
    let best = -1;
    let closest = near * near;
    this.trial.cars.forEach((_, car) => {
      const pose = this.trial.pose(car, time);
      const gap = (pose.x - x) ** 2 + (pose.y - y) ** 2;
      if (gap <= closest) [best, closest] = [car, gap];
    });
    return best;
  }

  draw(time, chosen, show) {
    const { context: c, camera, trial } = this;
    if (show.follow) Object.assign(camera, (({ x, y }) => ({ x, y }))(trial.pose(chosen, time)));
    this.pixel = 1 / camera.scale;
    this.drawStanding(time, show);
    this.inMetres();
    if (show.trails) trial.cars.forEach((_, index) => this.drawTrail(trial.cars.length - 1 - index, time));
    if (show.sensing) this.drawSensing(chosen, time);
    drawContacts(this, time, show);
    drawBreaches(this, time, show);
    for (let car = trial.cars.length - 1; car >= 0; car -= 1) this.drawCar(car, time, car === chosen);
    this.inPixels();
    if (show.labels) this.drawNames(time, chosen);
    nameBreaches(this, time, show);
    this.drawScale();
  }

  // All that does not move; it is kept once it has been drawn twice, since a camera that moves would keep it in vain.
  drawStanding(time, show) {
    const { context: c, camera, canvas, layer } = this;
    const { x, y, scale } = camera;
    const lit = [...this.trial.progress(time).lit].join();
    const key = [x, y, scale, canvas.width, canvas.height, show.lanes, show.labels, this.colours.ground, lit].join("|");
    c.setTransform(1, 0, 0, 1, 0, 0);
    if (key === layer.key) {
      c.drawImage(layer.canvas, 0, 0);
      return;
    }
    c.fillStyle = this.colours.ground;
    c.fillRect(0, 0, canvas.width, canvas.height);
    this.inMetres();
    this.drawRoads(show.lanes);
    this.drawGoals(time);
    this.inPixels();
    if (show.labels) this.drawPlaces();
    this.inMetres();
    this.drawObstacles();
    if (key === layer.last) {
      Object.assign(layer.canvas, { width: canvas.width, height: canvas.height });
      layer.canvas.getContext("2d").drawImage(canvas, 0, 0);
      layer.key = key;
    }
    layer.last = key;
  }

  inMetres() {
    const zoom = this.camera.scale * this.ratio;
    const [px, py] = this.camera.toScreen(0, 0);
    this.context.setTransform(zoom, 0, 0, -zoom, px * this.ratio, py * this.ratio);
  }

  inPixels() {
    this.context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
  }

  drawRoads(lanes) {
    const { context: c, trial, colours, pixel } = this;
    const wide = ([metres, pixels]) => Math.max(metres, pixels * pixel);
    const { kerb, centre, hint, dash } = LOOKS;
    c.lineCap = c.lineJoin = "round";
    c.strokeStyle = colours.kerb;
    c.lineWidth = trial.width + 2 * wide(kerb);
    c.stroke(this.roads);
    c.strokeStyle = colours.road;
    c.lineWidth = trial.width;
    c.stroke(this.roads);
    c.lineCap = "butt";
    c.strokeStyle = colours.line;
    c.lineWidth = wide(centre);
    c.setLineDash(dash);
    c.stroke(this.centres);
    c.setLineDash([]);
    if (!lanes) return;
    c.lineCap = "round";
    c.strokeStyle = colours.hint;
    c.lineWidth = wide(hint);
    c.stroke(this.hints);
  }

  drawGoals(time) {
    const { context: c, trial, colours, pixel } = this;
    const { lit } = trial.progress(time);
    for (const vertex of trial.goals.vertices) {
      c.beginPath();
      c.arc(...trial.points[vertex], trial.goals.radius, 0, 2 * Math.PI);
      c.fillStyle = colours.goal;
      c.globalAlpha = lit.has(vertex) ? 0.42 : 0.1;
      c.fill();
      c.globalAlpha = 1;
      c.strokeStyle = colours.goal;
      c.lineWidth = lit.has(vertex) ? 3 * pixel : 1.8 * pixel;
      c.setLineDash(lit.has(vertex) ? [] : [5 * pixel, 4 * pixel]);
      c.stroke();
      c.setLineDash([]);
    }
  }

  drawObstacles() {
    const { context: c, colours, pixel } = this;
    for (const { disc, polygon } of this.trial.obstacles) {
      c.beginPath();
      if (disc) c.arc(disc[0], disc[1], disc[2], 0, 2 * Math.PI);
      else polygon.forEach(([x, y]) => c.lineTo(x, y));
      c.closePath();
      c.fillStyle = colours.obstacle;
      c.fill();
      c.strokeStyle = colours.edge;
      c.lineWidth = 1.2 * pixel;
      c.stroke();
    }
  }

  // The way of the last seconds, fading, in a few strokes of equal opacity.
  drawTrail(car, time) {
    const { context: c, trial, pixel } = this;
    const [frame] = trial.place(time);
    const reach = TRAIL_SECONDS * trial.rate;
    const base = car * trial.stride;
    const pose = trial.pose(car, time);
    c.strokeStyle = trial.cars[car].colour;
    c.lineCap = "butt";
    c.lineWidth = Math.min(0.45 * trial.w, Math.max(0.22 * trial.w, 2.2 * pixel));
    for (let step = 0; step < TRAIL_STEPS; step += 1) {
      const from = Math.max(0, Math.round(frame - reach * (1 - step / TRAIL_STEPS)));
      const to = Math.max(0, Math.round(frame - reach * (1 - (step + 1) / TRAIL_STEPS)));
      const last = step === TRAIL_STEPS - 1;
      if (to <= from && !last) continue;
      c.globalAlpha = 0.9 * ((step + 1) / TRAIL_STEPS) ** 1.3;
      c.beginPath();
      for (let place = from; place <= to; place += 1) c.lineTo(trial.x[base + place], trial.y[base + place]);
      if (last) c.lineTo(pose.x, pose.y);
      c.stroke();
    }
    c.globalAlpha = 1;
  }

  drawSensing(chosen, time) {
    const { context: c, trial, colours, pixel } = this;
    const { x, y } = trial.pose(chosen, time);
    c.beginPath();
    c.arc(x, y, trial.sensing, 0, 2 * Math.PI);
    c.strokeStyle = colours.accent;
    c.lineWidth = 1.5 * pixel;
    c.setLineDash([3 * pixel, 5 * pixel]);
    c.stroke();
    c.setLineDash([]);
  }

  drawCar(car, time, chosen) {
    const { context: c, trial, colours, pixel } = this;
    const { x, y, theta } = trial.pose(car, time);
    const grow = Math.max(1, (5 * pixel) / trial.reach);
    const { radius } = trial.body;
    const long = grow * (radius ?? trial.body.length / 2);
    const wide = grow * (radius ?? trial.body.width / 2);
    c.save();
    c.translate(x, y);
    c.rotate(theta);
    if (chosen) {
      c.beginPath();
      c.arc(0, 0, grow * trial.reach + 4.5 * pixel, 0, 2 * Math.PI);
      c.strokeStyle = colours.accent;
      c.lineWidth = 1.6 * pixel;
      c.stroke();
    }
    c.beginPath();
    if (radius) c.arc(0, 0, long, 0, 2 * Math.PI);
    else c.rect(-long, -wide, 2 * long, 2 * wide);
    c.fillStyle = trial.cars[car].colour;
    c.fill();
    c.strokeStyle = colours.edge;
    c.lineWidth = 1.2 * pixel;
    c.lineJoin = "round";
    c.stroke();
    c.beginPath();
    c.moveTo(0.86 * long, 0);
    c.lineTo(0.12 * long, 0.56 * wide);
    c.lineTo(0.12 * long, -0.56 * wide);
    c.closePath();
    c.fillStyle = "#ffffff";
    c.fill();
    c.lineWidth = 0.8 * pixel;
    c.stroke();
    c.restore();
  }

  text(words, px, py, { size = 12, colour = this.colours.ink, weight = 500, align = "center" } = {}) {
    const { context: c } = this;
    c.font = font(size, weight);
    c.textAlign = align;
    c.textBaseline = "middle";
    c.lineJoin = "round";
    c.lineWidth = 3;
    c.strokeStyle = this.colours.halo;
    c.globalAlpha = 0.85;
    c.strokeText(words, px, py);
    c.globalAlpha = 1;
    c.fillStyle = colour;
    c.fillText(words, px, py);
  }

  // Lattice points; goals bear the numbers that they have in pictures, too.
  drawPlaces() {
    const { trial, camera, colours } = this;
    const goals = new Map(trial.goals.vertices.map((vertex, index) => [vertex, trial.goals.numbers[index]]));
    const small = camera.scale * trial.width;
    trial.points.forEach(([x, y], vertex) => {
      const goal = goals.get(vertex);
      const [px, py] = camera.toScreen(x, y);
      const size = Math.min(12, 0.28 * small);
      if (goal) this.text(`goal ${goal}`, px, size < 8 ? py : py - 7, { size: 13, weight: 700, colour: colours["goal-ink"] });
      if (size >= 8 && small >= 22) this.text(trial.latticeName(vertex), px, goal ? py + 8 : py, { size, colour: colours.faint });
    });
  }

  // Names above their cars, else below or beside; where many crowd, only those that find room.
  drawNames(time, chosen) {
    const { context: c, trial, camera } = this;
    c.font = font(12, 500);
    const lift = Math.max(camera.scale * trial.reach, 5) + 11;
    const taken = [];
    const order = trial.cars.map((_, car) => car).sort((a, b) => (b === chosen) - (a === chosen) || a - b);
    for (const car of order) {
      const { name } = trial.cars[car];
      const pose = trial.pose(car, time);
      const [px, py] = camera.toScreen(pose.x, pose.y);
      const half = c.measureText(name).width / 2 + 3;
      const places = [[0, -lift], [0, lift], [half + lift - 5, 0], [-half - lift + 5, 0]];
      const free = places.find(([dx, dy]) => taken.every(([x, y, wide]) => (
        Math.abs(px + dx - x) > half + wide || Math.abs(py + dy - y) > 14)));
      if (!free && trial.cars.length > CROWD && car !== chosen) continue;
      const [dx, dy] = free ?? places[0];
      taken.push([px + dx, py + dy, half]);
      this.text(name, px + dx, py + dy, { weight: car === chosen ? 700 : 500 });
    }
  }

  // A bar of 1, 2 or 5 times a power of ten metres, above the controls in the lower left corner if these reach below it.
  drawScale() {
    const { context: c, camera, colours } = this;
    const rough = 110 / camera.scale;
    const power = 10 ** Math.floor(Math.log10(rough));
    const metres = power * [5, 2, 1].find((step) => step * power <= rough);
    const length = metres * camera.scale;
    c.strokeStyle = colours.faint;
    c.lineWidth = 1.5;
    c.lineCap = "butt";
    c.beginPath();
    const right = camera.width - 16;
    const free = right - length > this.covered.right + 8;
    const low = camera.height - (free ? 14 : this.covered.high + 8);
    c.moveTo(right, low - 6);
    c.lineTo(right, low);
    c.lineTo(right - length, low);
    c.lineTo(right - length, low - 6);
    c.stroke();
    this.text(`${metres} m`, right - length / 2, low - 9, { size: 11, colour: colours.faint });
  }
}
