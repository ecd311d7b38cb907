// Driving: keys, a game pad or the buttons on the map, as throttle and wheel from -1 to 1.

const DRIVING = {
  ArrowUp: "go", ArrowDown: "reverse", ArrowLeft: "left", ArrowRight: "right", KeyW: "go", KeyS: "reverse", KeyA: "left", KeyD: "right",
};
const DEAD_ZONE = 0.15;
const FINE = 0.03;

const held = { keys: new Set(), pedals: new Map(), pad: [0, 0], sent: [0, 0] };
const drives = () => document.body.classList.contains("drives") && !stage.ended;

function wheel() {
  const pressed = new Set([...held.keys].map((code) => DRIVING[code]));
  for (const name of held.pedals.values()) pressed.add(name);
  if (pressed.size) return [pressed.has("go") - pressed.has("reverse"), pressed.has("left") - pressed.has("right")];
  return held.pad;
}

// Tell what is asked for, if it has changed.
function drive() {
  if (!drives()) return;
  const now = wheel();
  if (now.every((value, index) => Math.abs(value - held.sent[index]) < FINE)) return;
  held.sent = now;
  say({ drive: now });
  const start = find("start");
  if (now.some(Boolean) && !start.hidden) start.hidden = true;
}

function letGo() {
  held.keys.clear();
  held.pedals.clear();
  document.querySelectorAll("#pedals .held").forEach((button) => button.classList.remove("held"));
  drive();
}

function giveUp() {
  if (drives()) say({ give_up: true });
}

function listenToWheel() {
  document.addEventListener("keydown", (event) => {
    if (!drives() || event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    if (event.code in DRIVING) held.keys.add(event.code);
    else if (event.key === "q") giveUp();
    else return;
    drive();
    event.preventDefault();
    event.stopPropagation();
  }, true);
  document.addEventListener("keyup", (event) => {
    if (held.keys.delete(event.code)) drive();
  }, true);
  window.addEventListener("blur", letGo);
  document.addEventListener("visibilitychange", letGo);
  find("give-up").addEventListener("click", giveUp);
  for (const name of ["go", "left", "reverse", "right"]) {
    const button = find(name);
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId);
      button.classList.add("held");
      held.pedals.set(event.pointerId, name);
      drive();
      event.preventDefault();
    });
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) {
      button.addEventListener(kind, (event) => {
        button.classList.remove("held");
        if (held.pedals.delete(event.pointerId)) drive();
      });
    }
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }
}

const beyond = (value) => (Math.abs(value) < DEAD_ZONE ? 0 : Math.max(-1, Math.min(value, 1)));

// The left stick or the cross of a pad; the triggers go and brake.
function readPad() {
  const pad = navigator.getGamepads?.().find((one) => one?.connected);
  if (pad) {
    const value = (index) => pad.buttons[index]?.value ?? 0;
    const throttle = value(7) - value(6) + value(12) - value(13) - (pad.axes[1] ?? 0);
    held.pad = [beyond(throttle), beyond(value(14) - value(15) - (pad.axes[0] ?? 0))];
    drive();
  }
  requestAnimationFrame(readPad);
}

if (trial.live.plays) {
  listenToWheel();
  readPad();
}
connect();
play();
