// The strip above the slider: one sign for each mark, bars for marks that last.

const THUMB = 16;
const NEAR = 7;
const MARK_ROWS = { goal: 0.72, event: 0.5, breach: 0.5, contact: 0.28 };

class Timeline {
  constructor(canvas, trial) {
    this.canvas = canvas;
    this.trial = trial;
    this.span = Math.max(trial.end - trial.start, 1e-9);
  }

  left(time) {
    return THUMB / 2 + ((time - this.trial.start) / this.span) * (this.width - THUMB);
  }

  time(px) {
    const part = (px - THUMB / 2) / (this.width - THUMB);
    return this.trial.start + Math.min(Math.max(part, 0), 1) * this.span;
  }

  markAt(px) {
    let best = null;
    let closest = NEAR;
    for (const mark of this.trial.marks) {
      const gap = Math.abs(this.left(mark.time) - px);
      if (gap < closest) [best, closest] = [mark, gap];
    }
    return best;
  }

  draw() {
    const { canvas, trial } = this;
    const { width, height } = canvas.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    this.width = width;
    canvas.width = Math.max(1, Math.round(width * ratio));
    canvas.height = Math.max(1, Math.round(height * ratio));
    const c = canvas.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const style = getComputedStyle(document.documentElement);
    for (const mark of trial.marks) {
      const kind = mark.kind in MARK_ROWS ? mark.kind : "event";
      c.fillStyle = style.getPropertyValue(`--${kind}`);
      const x = this.left(mark.time);
      const y = MARK_ROWS[kind] * height;
      if (mark.since !== null) {
        const from = this.left(mark.since);
        c.globalAlpha = 0.45;
        c.fillRect(from, y - 2, Math.max(1, x - from), 4);
        c.globalAlpha = 1;
      }
      c.beginPath();
      if (kind === "goal") c.arc(x, y, 3.6, 0, 2 * Math.PI);
      else if (kind === "contact") {
        c.moveTo(x, y - 5.5);
        c.lineTo(x + 5, y);
        c.lineTo(x, y + 5.5);
        c.lineTo(x - 5, y);
      } else c.rect(x - 1.5, y - 6, 3, 12);
      c.fill();
    }
  }
}
