// The side panel: goals, cars, labels, score, events. Text is only ever set as text.

const MOST_EVENTS = 500;
const KEYS = [
  ["space", "play or pause"], ["← →", "one frame"], ["shift ← →", "one second"], ["home end", "first, last frame"],
  [", .", "previous, next event"], ["b shift b", "next, previous breach of the ego"], ["x", "what excused the ego"],
  ["o", "show the others' breaches or not"], ["< >", "slower, faster"], ["+ − 0", "zoom, fit"],
  ["f t l n r", "follow, trails, labels, lanes, sensing"], ["esc", "back to the ego"], ["?", "this legend"],
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
  constructor(trial, marks, show, { choose, go, filter }) {
    this.trial = trial;
    this.marks = marks;
    this.show = show;
    this.go = go;
    find("title").textContent = trial.title;
    this.goals = trial.goals.vertices.map(() => find("goals").appendChild(make("li")));
    find("goals-box").hidden = this.goals.length === 0;
    this.rows = trial.cars.map((car, index) => this.addCar(car, () => choose(index)));
    for (const [keys, effect] of KEYS) find("keys").append(make("dt", keys), make("dd", effect));
    find("excuse").addEventListener("click", () => this.go(this.trial.marks[this.trial.verdict.excuse]));
    this.filter = filter;
    this.filters = {};
    for (const group in GROUPS) this.show[group] = true;
    this.showEnd();
    this.listEvents();
  }

  // How the trial ended, its score and the verdict, as far as they are known.
  showEnd() {
    const { ending, running, summary } = this.trial;
    const words = running ? "Running" : "The record was cut off";
    find("ending").textContent = ending
      ? [`End: ${ending.end.replaceAll("_", " ")}`, ending.detail].filter(Boolean).join(", ") : words;
    find("score").replaceChildren(...summary.flatMap(([name, value]) => [make("dt", name), make("dd", value)]));
    find("score-box").hidden = summary.length === 0;
    this.showVerdict();
  }

  // What was decided, why, and the way to what excused it.
  showVerdict() {
    const { verdict } = this.trial;
    find("verdict-box").hidden = !verdict;
    if (!verdict) return;
    find("verdict").textContent = verdict.ruling;
    find("verdict").className = verdict.ruling;
    find("why").textContent = verdict.why;
    find("excuse").hidden = verdict.excuse === null;
  }

  // A filter for each group that has marks, with their number.
  listFilters() {
    const groups = Object.keys(GROUPS).filter((group) => this.marks.count(group));
    const added = groups.filter((group) => !this.filters[group]);
    for (const group of added) this.filters[group] = this.makeFilter(group);
    if (added.length) find("filters").append(...groups.map((group) => this.filters[group]));
    for (const group of groups) this.filters[group].lastChild.textContent = String(this.marks.count(group));
  }

  makeFilter(group) {
    const label = make("label", "", group);
    const box = label.appendChild(make("input"));
    Object.assign(box, { type: "checkbox", checked: true, id: `filter-${group}` });
    label.append(make("i"), make("span", `${GROUPS[group]} `), make("small"));
    box.addEventListener("change", () => {
      this.show[group] = box.checked;
      this.filter();
    });
    return label;
  }

  // List the marks that are shown, the first `MOST_EVENTS` of them.
  listEvents() {
    this.listFilters();
    const shown = this.marks.shown(this.show);
    this.listed = shown.slice(0, MOST_EVENTS);
    find("events").replaceChildren();
    this.events = this.listed.map((mark) => this.addEvent(mark));
    const few = shown.length > MOST_EVENTS ? `, the first ${MOST_EVENTS} listed` : "";
    const all = this.trial.marks.length;
    find("count").textContent = (shown.length < all ? `${shown.length} of ${all}` : `${all}`) + few;
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

  addEvent(mark) {
    const kind = mark.kind.replace(/[^a-z0-9_-]/gi, "-");
    const item = find("events").appendChild(make("li", "", mark.group === "others" ? "breach others" : kind));
    const button = item.appendChild(make("button"));
    button.type = "button";
    button.append(make("time", `${decimals(mark.time, 2)} s`), make("i"), make("span", mark.text));
    if (mark === this.trial.marks[this.trial.verdict?.excuse ?? -1]) button.append(make("em", "excuses the ego"));
    button.addEventListener("click", () => this.go(mark));
    return item;
  }

  update(time, chosen) {
    const { trial } = this;
    const { rounds, counts, lit } = trial.progress(time);
    find("rounds").textContent = `${rounds} round${rounds === 1 ? "" : "s"}`;
    trial.goals.vertices.forEach((vertex, index) => {
      const visits = counts.get(vertex);
      this.goals[index].classList.toggle("on", lit.has(vertex));
      this.goals[index].replaceChildren(
        make("b", `${trial.goals.numbers[index]}`), `  ${trial.latticeName(vertex)} × ${visits}`);
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
    this.events.forEach((item, index) => {
      const mark = this.listed[index];
      item.classList.toggle("past", mark.time <= time + 1e-9);
      const here = mark === this.marks.chosen && Math.abs(mark.time - time) < 1e-6;
      if (here && !item.classList.contains("here")) item.parentNode.scrollTop = item.offsetTop - item.parentNode.clientHeight / 2;
      item.classList.toggle("here", here);
    });
  }
}
