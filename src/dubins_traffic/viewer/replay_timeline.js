// The strip above the slider: one sign for each mark, bars for marks that last.

const THUMB = 16;
const NEAR = 7;
const MARK_ROWS = { goal: 0.8, event: 0.52, others: 0.52, breach: 0.24, contact: 0.24 };

class Timeline {
  constructor(canvas, trial, shown) {
    this.canvas = canvas;
    this.trial = trial;
    this.shown = shown;
    this.span = Math.max(trial.last - trial.start, 1e-9);
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
    for (const mark of this.shown()) {
      const gap = Math.abs(this.left(mark.time) - px);
      if (gap < closest) [best, closest] = [mark, gap];
    }
    return best;
  }

  draw() {
    const { canvas } = this;
    const { width, height } = canvas.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    this.width = width;
    canvas.width = Math.max(1, Math.round(width * ratio));
    canvas.height = Math.max(1, Math.round(height * ratio));
    const c = canvas.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const style = getComputedStyle(document.documentElement);
    for (const mark of this.shown()) this.drawMark(c, mark, style.getPropertyValue(`--${mark.group}`), height);
  }

  drawMark(c, mark, colour, height) {
    const x = this.left(mark.time);
    const y = MARK_ROWS[mark.group] * height;
    c.fillStyle = c.strokeStyle = colour;
    if (mark.since !== null) {
      const from = this.left(mark.since);
      c.globalAlpha = 0.45;
      c.fillRect(from, y - 2, Math.max(1, x - from), 4);
      c.globalAlpha = 1;
    }
    c.beginPath();
    if (mark.group === "goal") c.arc(x, y, 3.6, 0, 2 * Math.PI);
    else if (mark.group === "contact") {
      c.moveTo(x, y - 5.5);
      c.lineTo(x + 5, y);
      c.lineTo(x, y + 5.5);
      c.lineTo(x - 5, y);
    } else if (mark.group === "breach" || mark.group === "others") {
      c.moveTo(x, y - 5.5);
      c.lineTo(x + 5, y + 4);
      c.lineTo(x - 5, y + 4);
    } else c.rect(x - 1.5, y - 6, 3, 12);
    c.closePath();
    if (mark.group === "others") {
      c.lineWidth = 1.5;
      c.stroke();
    } else c.fill();
  }
}
