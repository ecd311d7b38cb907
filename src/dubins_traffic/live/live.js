// A trial that runs: frames and marks come over a socket, and the page follows the newest unless somebody looks back.

const BREACH_MS = 4000;
const LOST = "The program has ended; this page keeps what it was sent.";
const GONE = "The connection is lost, and the program may have ended; this page keeps what it was sent.";

const stage = { socket: null, ticks: 0, ended: false, changed: false, breachTimer: 0 };

// One page may be loaded again and is still the same player's.
function identity() {
  const known = sessionStorage.getItem("who") ?? Array.from(crypto.getRandomValues(new Uint8Array(12)), (byte) => byte.toString(16).padStart(2, "0")).join("");
  sessionStorage.setItem("who", known);
  return known;
}

function say(message) {
  if (stage.socket?.readyState === WebSocket.OPEN) stage.socket.send(JSON.stringify(message));
}

function follow() {
  state.follows = true;
  state.time = trial.end;
  play();
  refresh();
}

function warn(mark) {
  const sign = find("breach");
  sign.textContent = mark.text.replace(/^ego breaks/, trial.live.plays ? "You broke" : "The ego broke");
  sign.hidden = false;
  clearTimeout(stage.breachTimer);
  stage.breachTimer = setTimeout(() => { sign.hidden = true; }, BREACH_MS);
}

function setTurn(sign, text) {
  find("turn").dataset.state = sign;
  find("turn").textContent = text;
}

function end({ ending, summary, verdict, excuse }) {
  const same = (mark) => excuse && mark.time === excuse.time && mark.text === excuse.text;
  const at = trial.marks.findIndex(same);
  trial.running = false;
  stage.ended = true;
  Object.assign(trial, { ending, summary, verdict: verdict && { ...verdict, excuse: at < 0 ? null : at } });
  panel.showEnd();
  panel.listEvents();
  setTurn("free", "");
  find("now").hidden = true;
  if (trial.live.plays) find("give-up").hidden = true;
}

function setPlaces({ rows, sentence }) {
  find("places-box").hidden = false;
  find("place").textContent = sentence;
  find("places").tBodies[0].replaceChildren(...rows.map(({ cells, you }) => {
    const row = make("tr", "", you ? "you" : "");
    row.append(...cells.map((cell) => make("td", cell)));
    return row;
  }));
  find("panel").scrollTop = 0;
}

function hear(message) {
  switch (message.kind) {
    case "mark":
      trial.addMark(message.mark);
      stage.changed = true;
      if (message.mark.group === "breach") warn(message.mark);
      break;
    case "turn": setTurn(message.state, message.text); break;
    case "end": end(message); break;
    case "places": setPlaces(message); break;
    case "role": takeRole(message.drives); break;
    case "next": location.reload(); break;
  }
}

function receive({ data }) {
  if (typeof data === "string") {
    hear(JSON.parse(data));
    return;
  }
  const before = trial.frames;
  trial.append(data);
  stage.ticks += trial.frames - before;
}

// What came since, shown at most as often as the panel is.
function showNews() {
  if (stage.changed) {
    stage.changed = false;
    panel.listEvents();
    timeline.draw();
  }
  find("now").setAttribute("aria-pressed", String(state.follows));
  find("rate").hidden = state.follows;
}

function lose() {
  document.body.classList.remove("drives");
  trial.running = false;
  if (!stage.ended) find("ending").textContent = GONE;
  else find("ending").title = LOST;
}

function connect() {
  stage.socket = new WebSocket(`ws://${location.host}/socket?show=${trial.live.show}`);
  stage.socket.binaryType = "arraybuffer";
  stage.socket.addEventListener("open", () => say({ who: identity() }));
  stage.socket.addEventListener("message", receive);
  stage.socket.addEventListener("close", lose);
}

function takeRole(drives) {
  document.body.classList.toggle("drives", drives);
  if (!trial.live.plays) return;
  find("give-up").hidden = !drives;
  if (!drives) find("role").textContent = "Somebody else drives; you look on.";
  find("how").hidden = !drives;
  layOut();
}

find("now").addEventListener("click", follow);
setInterval(showNews, PANEL_PERIOD);
Object.assign(window.replay, { live: stage });
