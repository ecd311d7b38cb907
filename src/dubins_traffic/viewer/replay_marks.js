// Marks: the groups by which they are filtered, what of them is drawn on the map, and the steps from one to the next.

const RING_SECONDS = 1.2;
const NAMED_SECONDS = 2.5;
const GROUPS = {
  breach: "ego's breaches", others: "others' breaches", contact: "contacts", goal: "goals", event: "other events",
};

// The group of a mark: the breaches of the ego (car 0) are apart from those of the others.
function groupOf(mark) {
  if (mark.kind === "breach") return mark.car === 0 ? "breach" : "others";
  return mark.kind in GROUPS ? mark.kind : "event";
}

// The marks that are shown, and a cursor that steps through them; those of one instant in their order.
class Marks {
  constructor(trial) {
    this.trial = trial;
    this.chosen = null;
  }

  // How many marks of a group there are.
  count(group) {
    return this.trial.marks.filter((mark) => mark.group === group).length;
  }

  shown(show) {
    return this.trial.marks.filter(({ group }) => show[group] !== false);
  }

  // The mark that a step leads to, forward (1) or back (-1), among those that `wanted` says; undefined: there is none.
  step(way, time, wanted) {
    const { marks } = this.trial;
    const at = this.chosen && Math.abs(this.chosen.time - time) < 1e-6 ? marks.indexOf(this.chosen) : null;
    const beyond = (mark, index) => (at === null ? way * (mark.time - time) > 1e-6 : way * (index - at) > 0);
    const found = marks.filter((mark, index) => wanted(mark) && beyond(mark, index));
    return way > 0 ? found[0] : found[found.length - 1];
  }
}

function ring(map, [x, y], colour, age) {
  const { context: c, trial, pixel } = map;
  c.strokeStyle = colour;
  c.globalAlpha = 1 - age;
  c.lineWidth = 3 * pixel;
  c.beginPath();
  c.arc(x, y, (1.5 + 1.5 * age) * Math.max(trial.reach, 10 * pixel), 0, 2 * Math.PI);
  c.stroke();
  c.globalAlpha = 1;
}

function drawContacts(map, time, show) {
  if (show.contact === false) return;
  const { context: c, trial, colours, pixel } = map;
  for (const { time: when, point: [x, y] } of trial.contacts) {
    if (when > time) break;
    const arm = Math.max(0.3 * trial.w, 4 * pixel);
    for (const [colour, width] of [[colours.halo, 4.5], [colours.contact, 2.4]]) {
      c.strokeStyle = colour;
      c.lineWidth = width * pixel;
      c.lineCap = "round";
      c.beginPath();
      c.moveTo(x - arm, y - arm);
      c.lineTo(x + arm, y + arm);
      c.moveTo(x - arm, y + arm);
      c.lineTo(x + arm, y - arm);
      c.stroke();
    }
    const age = (time - when) / RING_SECONDS;
    if (age < 1) ring(map, [x, y], colours.contact, age);
  }
}

// A triangle at the place of each breach so far: filled for the ego's, hollow for the others'.
function drawBreaches(map, time, show) {
  const { context: c, trial, colours, pixel } = map;
  const size = Math.max(0.42 * trial.w, 6.5 * pixel);
  for (const { time: when, group, point: [x, y] } of trial.breaches) {
    if (when > time + 1e-9) break;
    if (show[group] === false) continue;
    const colour = colours[group];
    c.beginPath();
    c.moveTo(x, y + size);
    c.lineTo(x + 0.9 * size, y - 0.6 * size);
    c.lineTo(x - 0.9 * size, y - 0.6 * size);
    c.closePath();
    c.lineJoin = "round";
    c.strokeStyle = colours.halo;
    c.lineWidth = 5 * pixel;
    c.stroke();
    c.fillStyle = group === "breach" ? colour : colours.halo;
    c.fill();
    c.strokeStyle = colour;
    c.lineWidth = 2 * pixel;
    c.stroke();
    const age = (time - when) / RING_SECONDS;
    if (age < 1) ring(map, [x, y], colour, age);
  }
}

// The rule that was broken, beside the triangles of the last moments.
function nameBreaches(map, time, show) {
  const { trial, camera, colours } = map;
  const recent = trial.breaches.filter(({ time: when, group }) => (
    show[group] !== false && when <= time + 1e-9 && time - when < NAMED_SECONDS));
  const taken = new Set();
  for (const { group, point, rule } of recent.reverse()) {
    const [px, py] = camera.toScreen(...point);
    const place = `${Math.round(px / 40)} ${Math.round(py / 16)}`;
    if (taken.has(place)) continue;
    taken.add(place);
    map.text(rule ?? "", px, py + 19, { weight: 700, colour: colours[group] });
  }
}
