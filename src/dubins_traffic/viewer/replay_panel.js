// The side panel: goals, cars, labels, score, events. Text is only ever set as text.

const MOST_EVENTS = 500;
const KEYS = [
  ["space", "play or pause"], ["← →", "one frame"], ["shift ← →", "one second"], ["home end", "first, last frame"],
  ["< >", "slower, faster"], ["+ − 0", "zoom, fit"], ["f t l n r", "follow, trails, labels, lanes, sensing"],
];

function make(tag, text = "", className = "") {
  const element = document.createElement(tag);
  element.textContent = text;
  if (className) element.className = className;
  return element;
}

const find = (id) => document.getElementById(id);
const decimals = (value, places) => value.toFixed(places).replace("-", "−");

class Panel {
  constructor(trial, { choose, seek }) {
    this.trial = trial;
    find("title").textContent = trial.title;
    find("ending").textContent = trial.ending
      ? [`End: ${trial.ending.end.replaceAll("_", " ")}`, trial.ending.detail].filter(Boolean).join(", ")
      : "The record was cut off";
    this.goals = trial.goals.vertices.map((vertex) => find("goals").appendChild(make("li", trial.lattice[vertex].join(","))));
    find("goals-box").hidden = this.goals.length === 0;
    this.rows = trial.cars.map((car, index) => this.addCar(car, () => choose(index)));
    for (const [name, value] of trial.summary) find("score").append(make("dt", name), make("dd", value));
    find("score-box").hidden = trial.summary.length === 0;
    for (const [keys, effect] of KEYS) find("keys").append(make("dt", keys), make("dd", effect));
    this.events = trial.marks.slice(0, MOST_EVENTS).map((mark) => this.addEvent(mark, seek));
    const rest = trial.marks.length - this.events.length;
    find("count").textContent = rest > 0 ? `${trial.marks.length}, the first ${MOST_EVENTS} listed` : `${trial.marks.length}`;
  }

  addCar({ name, kind, colour }, choose) {
    const row = find("cars").tBodies[0].appendChild(make("tr"));
    const button = row.appendChild(make("td")).appendChild(make("button"));
    button.type = "button";
    button.title = kind === name ? name : `${name}: ${kind}`;
    const swatch = button.appendChild(make("i", "", "swatch"));
    swatch.style.background = colour;
    button.append(make("span", name));
    button.addEventListener("click", choose);
    return { row, cells: ["", "", "", ""].map(() => row.appendChild(make("td"))) };
  }

  addEvent(mark, seek) {
    const item = find("events").appendChild(make("li", "", mark.kind.replace(/[^a-z0-9_-]/gi, "-")));
    const button = item.appendChild(make("button"));
    button.type = "button";
    button.append(make("time", `${decimals(mark.time, 2)} s`), make("i"), make("span", mark.text));
    button.addEventListener("click", () => seek(mark.time));
    return item;
  }

  update(time, chosen) {
    const { trial } = this;
    const { rounds, counts, lit } = trial.progress(time);
    find("rounds").textContent = `${rounds} round${rounds === 1 ? "" : "s"}`;
    trial.goals.vertices.forEach((vertex, index) => {
      const visits = counts.get(vertex);
      this.goals[index].classList.toggle("on", lit.has(vertex));
      this.goals[index].textContent = `${trial.lattice[vertex].join(",")} × ${visits}`;
    });
    this.rows.forEach(({ row, cells }, car) => {
      const pose = trial.pose(car, time);
      const values = [
        `${decimals(pose.x + trial.origin[0], 2)}, ${decimals(pose.y + trial.origin[1], 2)}`,
        decimals((pose.theta * 180) / Math.PI, 0), decimals(pose.speed, 2), decimals(pose.yawRate, 2),
      ];
      values.forEach((value, index) => {
        cells[index].textContent = value;
      });
      row.classList.toggle("chosen", car === chosen);
    });
    find("chosen").textContent = trial.cars[chosen].name;
    find("current").replaceChildren(...trial.labels(chosen, time).map((label) => make("code", label)));
    find("propositions").textContent = trial.propositions(chosen, time).join(", ").replaceAll("_", " ");
    this.events.forEach((item, index) => item.classList.toggle("past", trial.marks[index].time <= time + 1e-9));
  }
}
