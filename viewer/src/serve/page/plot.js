// Line plots over time, on a canvas.

const COLORS = ["#2f7ed8", "#e4572e", "#2e9e5b", "#a35bd6", "#c7961a", "#17a2b8", "#d6438f", "#7a8b2d"];
const SPAN = 10; // displayed time span, in seconds of simulation
const MOST_SAMPLES = 2000;

class History {
  constructor() { this.clear(); }

  clear() { this.times = []; this.rows = []; }

  /** Adds a sample: time [s] and one number per column. If time goes back (a reset), the history restarts. */
  add(time, row) {
    const last = this.times[this.times.length - 1];
    if (last !== undefined && time < last) this.clear();
    if (time === last) { this.rows[this.rows.length - 1] = row; return; }
    this.times.push(time);
    this.rows.push(row);
    const keep = this.times.findIndex((t) => t >= time - SPAN);
    const drop = Math.max(keep, this.times.length - MOST_SAMPLES);
    if (drop > 0) { this.times.splice(0, drop); this.rows.splice(0, drop); }
  }
}

/** Returns a step of 1, 2 or 5 times a power of ten, such that about `count` steps cover `range`. */
function niceStep(range, count) {
  const raw = range / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const factor = [1, 2, 5, 10].find((f) => f * power >= raw) ?? 10;
  return factor * power;
}

/** Draws the columns of a history: `lines` are {column, color}. */
function plot(canvas, history, lines, unit) {
  const scale = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (width < 40 || height < 40) return;
  const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  const style = getComputedStyle(canvas);
  const soft = style.getPropertyValue("color");
  const times = history.times;
  const end = times.length ? Math.max(times[times.length - 1], SPAN) : SPAN;
  const start = end - SPAN;
  let [low, high] = [Infinity, -Infinity];
  for (const row of history.rows) {
    for (const { column } of lines) {
      const y = row[column];
      if (Number.isFinite(y)) { low = Math.min(low, y); high = Math.max(high, y); }
    }
  }
  if (low > high) [low, high] = [-1, 1];
  const margin = Math.max((high - low) * 0.08, 1e-3, Math.abs(high) * 1e-3);
  low -= margin;
  high += margin;
  const [left, bottom, top] = [46, 18, 6];
  const x = (t) => left + (t - start) / SPAN * (width - left - 6);
  const y = (v) => height - bottom - (v - low) / (high - low) * (height - bottom - top);
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = soft;
  pen.strokeStyle = soft;
  pen.lineWidth = 1;
  const step = niceStep(high - low, 4);
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
    pen.globalAlpha = 0.2;
    pen.beginPath(); pen.moveTo(left, y(v)); pen.lineTo(width - 6, y(v)); pen.stroke();
    pen.globalAlpha = 0.8;
    pen.fillText((Math.abs(v) < step / 2 ? 0 : v).toFixed(Math.min(digits, 6)), left - 5, y(v));
  }
  pen.textAlign = "center";
  pen.textBaseline = "alphabetic";
  for (let t = Math.ceil(start / 2) * 2; t <= end; t += 2) {
    pen.globalAlpha = 0.8;
    pen.fillText(`${t} s`, Math.min(x(t), width - 16), height - 4);
  }
  pen.textAlign = "left";
  pen.fillText(unit, 2, height - 4);
  pen.globalAlpha = 1;
  pen.lineWidth = 1.6;
  pen.lineJoin = "round";
  for (const { column, color } of lines) {
    pen.strokeStyle = color;
    pen.beginPath();
    let drawing = false;
    times.forEach((t, k) => {
      const value = history.rows[k][column];
      if (!Number.isFinite(value)) { drawing = false; return; }
      if (drawing) pen.lineTo(x(t), y(value)); else pen.moveTo(x(t), y(value));
      drawing = true;
    });
    pen.stroke();
  }
}
