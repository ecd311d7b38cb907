// The trial: unpacked series, and what can be asked of it at any instant.

const HEADING_STEPS = 32767;

function unpack(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// Runs (see _runs in replay.py) as one value per car and frame.
function unpackRuns(text, cars, frames) {
  const packed = unpack(text, Int32Array);
  const values = new Int32Array(cars * frames);
  let place = 0;
  for (let car = 0; car < cars; car += 1) {
    const runs = packed[place];
    place += 1;
    for (let run = 0; run < runs; run += 1, place += 2) {
      const last = run + 1 < runs ? packed[place + 2] : frames;
      values.fill(packed[place + 1], car * frames + packed[place], car * frames + last);
    }
  }
  return values;
}

function pairs(values, size) {
  const rows = [];
  for (let place = 0; place < values.length; place += size) rows.push(values.subarray(place, place + size));
  return rows;
}

const SERIES = ["x", "y", "heading", "speed", "yawRate", "segment", "at", "bits"];
const INTEGERS = 5;

// The series are car after car: `stride` frames of each, of which the first `frames` are there; while a trial runs more
// come, until `last`, the time of the last one that is planned.
class Trial {
  constructor({ roads, series, first, ...rest }) {
    Object.assign(this, rest);
    this.start = first / this.rate;
    this.end = (first + this.frames - 1) / this.rate;
    this.width = roads.width;
    this.lattice = roads.lattice;
    this.segments = roads.segments;
    this.points = pairs(unpack(roads.points, Float32Array), 2);
    this.ends = pairs(unpack(roads.ends, Int32Array), 2);
    const lines = roads.lines ? pairs(unpack(roads.lines, Float32Array), 4) : null;
    this.lines = lines ?? this.ends.map(([first, second]) => [...this.points[first], ...this.points[second]]);
    this.centres = pairs(unpack(roads.centres, Float32Array), 4);
    this.hints = pairs(unpack(roads.hints, Float32Array), 6);
    for (const name of ["x", "y", "speed", "yawRate"]) this[name] = unpack(series[name], Float32Array);
    this.heading = unpack(series.heading, Int16Array);
    for (const name of ["segment", "at", "bits"]) {
      this[name] = unpackRuns(series[name], this.cars.length, this.frames);
    }
    this.stride = this.frames;
    this.last = this.end;
    if (this.live) this.reserve(this.live.frames);
    this.reach = this.body.radius ?? Math.hypot(this.body.length, this.body.width) / 2;
    for (const mark of this.marks) mark.group = groupOf(mark);
    this.contacts = this.marks.filter((mark) => mark.kind === "contact" && mark.point);
    this.breaches = this.marks.filter((mark) => mark.kind === "breach" && mark.point);
  }

  // Make room for all frames of a trial that runs.
  reserve(frames) {
    for (const name of SERIES) {
      const longer = new this[name].constructor(this.cars.length * frames);
      this.cars.forEach((_, car) => longer.set(this[name].subarray(car * this.stride, car * this.stride + this.frames), car * frames));
      this[name] = longer;
    }
    this.stride = frames;
    this.last = this.start + (frames - 1) / this.rate;
    this.running = true;
  }

  // Append frames that have come; their form is that of Show.tick in live/show.py.
  append(buffer) {
    const cars = this.cars.length;
    const size = 4 * (1 + SERIES.length * cars);
    const view = new DataView(buffer);
    for (let place = 0; place < buffer.byteLength; place += size) {
      const frame = view.getUint32(place, true);
      SERIES.forEach((name, row) => {
        for (let car = 0; car < cars; car += 1) {
          const at = place + 4 * (1 + row * cars + car);
          const value = row < INTEGERS ? view.getFloat32(at, true) : view.getInt32(at, true);
          this[name][car * this.stride + frame] = name === "heading" ? Math.round((value * HEADING_STEPS) / Math.PI) : value;
        }
      });
      this.frames = frame + 1;
    }
    this.end = this.time(this.frames - 1);
    this.countVisits();
  }

  // Note the visits of goals in frames that have come.
  countVisits() {
    const { visits, vertices } = this.goals;
    for (this.seen ??= 1; this.seen < this.frames; this.seen += 1) {
      const at = this.at[this.seen];
      if (at !== this.at[this.seen - 1] && vertices.includes(at)) visits.push([this.seen, at]);
    }
  }

  // Take a mark that has come; marks come in order of time.
  addMark(mark) {
    mark.group = groupOf(mark);
    this.marks.push(mark);
    if (mark.kind === "contact" && mark.point) this.contacts.push(mark);
    if (mark.kind === "breach" && mark.point) this.breaches.push(mark);
  }

  // Number of the last frame at or before the time, and how far the next one is on its way to it.
  place(time) {
    const exact = (Math.min(Math.max(time, this.start), this.end) - this.start) * this.rate;
    const frame = Math.min(Math.floor(exact + 1e-6), this.frames - 1);
    return [frame, frame + 1 < this.frames ? Math.max(0, exact - frame) : 0];
  }

  time(frame) {
    return this.start + frame / this.rate;
  }

  // Position (relative to the origin) and heading between frames; speeds as of the last frame.
  pose(car, time) {
    const [frame, part] = this.place(time);
    const here = car * this.stride + frame;
    const next = part > 0 ? here + 1 : here;
    const turn = ((this.heading[next] - this.heading[here] + 3 * HEADING_STEPS) % (2 * HEADING_STEPS)) - HEADING_STEPS;
    return {
      x: this.x[here] + part * (this.x[next] - this.x[here]),
      y: this.y[here] + part * (this.y[next] - this.y[here]),
      theta: ((this.heading[here] + part * turn) * Math.PI) / HEADING_STEPS,
      speed: this.speed[here],
      yawRate: this.yawRate[here],
    };
  }

  // The labels of 2016: nearest segment, and the intersection whose disc holds the centre.
  labels(car, time) {
    const here = car * this.stride + this.place(time)[0];
    const { name } = this.cars[car];
    const segment = this.segments[this.segment[here]];
    const point = this.lattice[this.at[here]];
    return [segment && `${name}_s_${segment.join("_")}`, point && `${name}_t_${point.join("_")}`].filter(Boolean);
  }

  // A lattice point as pictures show it.
  latticeName(vertex) {
    return this.lattice[vertex].map((value) => Number(value.toFixed(2)) + 0).join(",");
  }

  // The propositions that hold of a car, by name.
  propositions(car, time) {
    const bits = this.bits[car * this.stride + this.place(time)[0]];
    return Object.keys(this.flags).filter((name) => bits & this.flags[name]);
  }

  // Which goals are lit: those visited in the round under way, and the one the ego is in; rounds and visits so far.
  progress(time) {
    const [frame] = this.place(time);
    const counts = new Map(this.goals.vertices.map((vertex) => [vertex, 0]));
    const lit = new Set();
    let rounds = 0;
    for (const [when, vertex] of this.goals.visits) {
      if (when > frame) break;
      counts.set(vertex, counts.get(vertex) + 1);
      lit.add(vertex);
      if (lit.size === counts.size) {
        rounds += 1;
        lit.clear();
      }
    }
    if (counts.has(this.at[frame])) lit.add(this.at[frame]);
    return { rounds, counts, lit };
  }
}

// Add lines [x0, y0, x1, y1] to a path; one that begins where the last ended goes on with it, so that strokes do, too.
function addLines(path, lines) {
  let x, y;
  for (const [x0, y0, x1, y1] of lines) {
    if (x0 !== x || y0 !== y) path.moveTo(x0, y0);
    path.lineTo(x1, y1);
    [x, y] = [x1, y1];
  }
}
