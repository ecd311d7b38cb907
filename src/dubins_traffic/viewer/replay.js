// The page: clock, controls, keys, pointers. Tests and scripts speak to window.replay.

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
const SWITCHES = { f: "follow", t: "trails", l: "labels", n: "lanes", r: "sensing" };
const PANEL_PERIOD = 100;
const KEY_PAN = 60;
const VIEW_WIDTHS = 8;
const LATE_SECONDS = 0.3;

const trial = new Trial(JSON.parse(find("data").textContent));
const state = { time: trial.begin ?? trial.start, playing: false, follows: false, chosen: 0, speed: 1, fitted: true, panelAt: 0, last: null, pictures: 0 };
const map = new MapView(find("map"), trial);
const show = {};
const marks = new Marks(trial);
const timeline = new Timeline(find("timeline"), trial, () => marks.shown(show));
const panel = new Panel(trial, marks, show, { choose, go, filter });
const slider = find("slider");
let asked = false;

Object.assign(slider, { min: trial.start, max: trial.last, step: 1 / trial.rate, value: trial.start });

function draw() {
  map.draw(state.time, state.chosen, show);
  state.pictures += 1;
}

function refresh(force = true) {
  const now = performance.now();
  if (force || now - state.panelAt >= PANEL_PERIOD) {
    slider.value = state.time;
    slider.setAttribute("aria-valuetext", `${decimals(state.time, 2)} s of ${decimals(trial.last, 2)} s`);
    find("clock").textContent = `${decimals(state.time, 2)} / ${decimals(trial.last, 2)} s`;
    panel.update(state.time, state.chosen);
    state.panelAt = now;
  }
  draw();
}

function tick(now) {
  asked = false;
  if (!state.playing) return;
  const passed = state.last === null ? 0 : (now - state.last) / 1000;
  state.last = now;
  const speed = state.follows ? trial.live.pace : state.speed;
  state.time = Math.min(trial.end, state.time + Math.min(passed, 0.25) * speed);
  if (state.follows && trial.end - state.time > LATE_SECONDS * speed) state.time = trial.end;
  if (state.time >= trial.end && !trial.running) pause();
  else ask();
  refresh(!state.playing);
}

function ask() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(tick);
}

function reflect() {
  document.body.classList.toggle("playing", state.playing);
  find("play").setAttribute("aria-label", state.playing ? "Pause" : "Play");
}

function play() {
  if (state.playing || (trial.frames < 2 && !trial.running)) return;
  if (state.time >= trial.end) {
    if (trial.running) state.follows = true;
    else state.time = trial.start;
  }
  state.playing = true;
  state.last = null;
  reflect();
  ask();
}

function pause() {
  state.playing = state.follows = false;
  reflect();
  refresh();
}

function toggle() {
  if (state.playing) pause();
  else play();
}

function seek(time) {
  state.time = Math.min(Math.max(Number(time), trial.start), trial.end);
  state.follows = state.playing && trial.running && state.time >= trial.end;
  refresh();
}

function step(frames) {
  if (state.playing) pause();
  const [frame, part] = trial.place(state.time);
  seek(trial.time(frames < 0 && part > 1e-3 ? frame + 1 + frames : frame + frames));
}

// Go to a mark: its instant, its car, and, if it lies beyond the map, its place.
function go(mark) {
  if (!mark) return;
  pause();
  marks.chosen = mark;
  if (mark.car >= 0) state.chosen = mark.car;
  if (mark.point && !map.holds(...mark.point)) {
    state.fitted = false;
    [map.camera.x, map.camera.y] = mark.point;
  }
  find("stage").scrollIntoView({ block: "nearest" });
  seek(mark.time);
}

function stepMark(way, wanted = ({ group }) => show[group]) {
  go(marks.step(way, state.time, wanted));
}

const isOwnBreach = ({ group }) => group === "breach";

function filter() {
  panel.listEvents();
  timeline.draw();
  refresh();
}

function toggleFilter(group) {
  find(`filter-${group}`)?.click();
}

function toggleKeys() {
  const box = find("legend");
  box.open = !box.open;
  if (box.open) box.scrollIntoView({ block: "nearest" });
}

function choose(car) {
  state.chosen = car;
  refresh();
}

function setSpeed(speed) {
  state.speed = speed;
  find("speed").value = String(speed);
}

function fit() {
  state.fitted = true;
  const [stage, buttons] = ["stage", "zoom"].map((id) => find(id).getBoundingClientRect());
  const inRow = buttons.width > buttons.height;
  map.fit({
    above: inRow ? buttons.bottom - stage.top : 0,
    right: inRow ? 0 : stage.right - buttons.left,
    below: map.covered.high,
  });
  draw();
}

// Come near a car that is to be followed, unless somebody has chosen how near.
function approach() {
  if (!state.fitted) return;
  state.fitted = false;
  const { camera } = map;
  camera.scale = Math.max(camera.scale, Math.min(camera.width, camera.height) / (VIEW_WIDTHS * trial.width));
}

function zoom(factor, px, py) {
  state.fitted = false;
  map.camera.zoom(factor, px, py);
  draw();
}

function pan(dx, dy) {
  state.fitted = false;
  find("follow").checked = show.follow = false;
  map.camera.pan(dx, dy);
  draw();
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  map.recolour();
  timeline.draw();
  draw();
}

function listenToControls() {
  find("play").addEventListener("click", toggle);
  find("back").addEventListener("click", () => step(-1));
  find("forward").addEventListener("click", () => step(1));
  find("previous").addEventListener("click", () => stepMark(-1));
  find("next").addEventListener("click", () => stepMark(1));
  find("help").addEventListener("click", toggleKeys);
  slider.addEventListener("input", () => seek(slider.value));
  find("zoom-in").addEventListener("click", () => zoom(1.4));
  find("zoom-out").addEventListener("click", () => zoom(1 / 1.4));
  find("fit").addEventListener("click", fit);
  for (const speed of SPEEDS) find("speed").append(new Option(`${speed}×`, String(speed)));
  setSpeed(1);
  find("speed").addEventListener("change", () => setSpeed(Number(find("speed").value)));
  for (const name of Object.values(SWITCHES)) {
    show[name] = find(name).checked;
    find(name).addEventListener("change", () => {
      show[name] = find(name).checked;
      if (name === "follow" && show.follow) approach();
      draw();
    });
  }
  const dark = matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", () => setTheme(dark.matches ? "dark" : "light"));
  find("theme").addEventListener("click", () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  document.documentElement.dataset.theme = dark.matches ? "dark" : "light";
  const strip = find("timeline");
  strip.addEventListener("click", ({ offsetX }) => {
    const mark = timeline.markAt(offsetX);
    if (mark) go(mark);
    else seek(timeline.time(offsetX));
  });
  strip.addEventListener("pointermove", ({ offsetX }) => {
    strip.title = timeline.markAt(offsetX)?.text ?? "";
  });
}

function listenToPointers() {
  const canvas = find("map");
  const held = new Map();
  let travelled = 0;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.offsetX, event.offsetY]);
    travelled = 0;
    canvas.classList.add("dragging");
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.offsetX - before[0], event.offsetY - before[1]];
    travelled += Math.hypot(dx, dy);
    held.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (travelled < 4) return;
    pan(dx / held.size, dy / held.size);
    const other = [...held].find(([id]) => id !== event.pointerId)?.[1];
    if (!other) return;
    const span = Math.hypot(before[0] - other[0], before[1] - other[1]);
    const now = Math.hypot(event.offsetX - other[0], event.offsetY - other[1]);
    if (span > 10) zoom(now / span, (event.offsetX + other[0]) / 2, (event.offsetY + other[1]) / 2);
  });
  const release = (event) => {
    if (held.delete(event.pointerId) && event.type === "pointerup" && travelled < 4) {
      const car = map.carAt(event.offsetX, event.offsetY, state.time);
      if (car >= 0) choose(car);
    }
    if (held.size === 0) canvas.classList.remove("dragging");
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), event.offsetX, event.offsetY);
  }, { passive: false });
}

const ACTIONS = {
  ArrowLeft: (event) => (event.shiftKey ? seek(state.time - 1) : step(-1)),
  ArrowRight: (event) => (event.shiftKey ? seek(state.time + 1) : step(1)),
  Home: () => seek(trial.start),
  End: () => seek(trial.end),
  ",": () => stepMark(-1),
  ".": () => stepMark(1),
  b: () => stepMark(1, isOwnBreach),
  B: () => stepMark(-1, isOwnBreach),
  x: () => go(trial.marks[trial.verdict?.excuse ?? -1]),
  o: () => toggleFilter("others"),
  "?": toggleKeys,
  Escape: () => choose(0),
  "<": () => setSpeed(SPEEDS[Math.max(0, SPEEDS.indexOf(state.speed) - 1)]),
  ">": () => setSpeed(SPEEDS[Math.min(SPEEDS.length - 1, SPEEDS.indexOf(state.speed) + 1)]),
  "+": () => zoom(1.25),
  "=": () => zoom(1.25),
  "-": () => zoom(0.8),
  0: fit,
};
const PANS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

function listenToKeys() {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { target, key } = event;
    const native = target.closest("button, select, summary, input[type=checkbox]");
    if (key === " ") {
      if (native) return;
      toggle();
    } else if (target.id === "map" && key in PANS && !event.shiftKey) {
      pan(...PANS[key].map((part) => part * KEY_PAN));
    } else if (key in SWITCHES) {
      find(SWITCHES[key]).click();
    } else if (key in ACTIONS && target.tagName !== "SELECT") {
      ACTIONS[key](event);
    } else {
      return;
    }
    event.preventDefault();
  });
}

function layOut() {
  map.resize();
  const [stage, toggles] = ["stage", "toggles"].map((id) => find(id).getBoundingClientRect());
  map.covered = { right: toggles.right - stage.left, high: stage.bottom - toggles.top };
  timeline.draw();
  if (state.fitted) fit();
  else draw();
}

listenToControls();
listenToPointers();
listenToKeys();
map.recolour();
new ResizeObserver(layOut).observe(find("stage"));
window.addEventListener("resize", layOut);
// Not every browser tells when only the ratio has changed, as for a window that is moved to another screen.
setInterval(() => {
  if ((window.devicePixelRatio || 1) !== map.ratio) layOut();
}, 500);
layOut();
refresh();

window.replay = {
  get ready() { return true; },
  get time() { return state.time; },
  get playing() { return state.playing; },
  get start() { return trial.start; },
  get end() { return trial.end; },
  get frames() { return trial.frames; },
  get running() { return trial.running === true; },
  get pictures() { return state.pictures; },
  get frame() { return trial.place(state.time)[0]; },
  get chosen() { return state.chosen; },
  get mark() { return marks.chosen; },
  get shown() { return marks.shown(show); },
  pose: (car) => trial.pose(car, state.time),
  at: (x, y) => map.camera.toScreen(x, y),
  seek, play, pause,
};
