// The film on its canvas: tiles, the reading laid over them, edits, ruler and the strip that shows the whole.

import { ask, token } from "./ask.js?token=TOKEN";
import { rate, secondsOf } from "./axis.js?token=TOKEN";

const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9"]; // Okabe and Ito (2008)
const STEPS = [0.1, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800, 3600]; // s from label to label
export const TICKS = 0.2; // zoom from which on marks are drawn
export const RULER = 84; // px at the left that show times
const TILE = 512, MOST_TILES = 240, AT_ONCE = 4;
const canvas = document.getElementById("film"), strip = document.getElementById("strip");
const pen = canvas.getContext("2d"), stripPen = strip.getContext("2d");

// place of the canvas's middle on the film, and px of the screen to a px of the film
export const view = { row: 0, column: 0, zoom: 0 };
// what is drawn: the state, whether without the reading, the doubtful place at hand, what a tool is about to make
export const shown = { state: null, bare: false, doubt: null, sketch: null };
export const colour = (trace) => COLOURS[(trace - 1) % COLOURS.length];
export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

const middle = () => [(canvas.clientWidth + RULER) / 2, canvas.clientHeight / 2];
export function toScreen(row, column) {
  const [x, y] = middle();
  return [x + (column - view.column) * view.zoom, y + (row - view.row) * view.zoom];
}
export function toFilm(x, y) {
  const [midX, midY] = middle();
  return [view.row + (y - midY) / view.zoom, view.column + (x - midX) / view.zoom];
}

// ---- moving about
export function go(row, column = view.column) {
  view.row = clamp(row, 0, shown.state.rows);
  view.column = clamp(column, 0, shown.state.columns);
  seek = null;
  soon();
}
export const pan = (x, y) => go(view.row + y / view.zoom, view.column + x / view.zoom);
export const fitWidth = () => (canvas.clientWidth - RULER - 24) / shown.state.columns;
export function zoomBy(factor, x = middle()[0], y = middle()[1]) {
  const [row, column] = toFilm(x, y), [midX, midY] = middle();
  view.zoom = clamp(view.zoom * factor, 2 ** -(shown.state.levels + 1), 16);
  go(row - (y - midY) / view.zoom, column - (x - midX) / view.zoom);
}
export function showRows(first, last, trace) { // so that the rows fit, and the trace with them
  view.zoom = clamp((0.7 * canvas.clientHeight) / Math.max(last - first, 1), 2 ** -shown.state.levels, 2);
  const wide = view.zoom > fitWidth();
  go((first + last) / 2, wide ? view.column : shown.state.columns / 2);
  seek = wide ? trace : null;
}
export function whole() { // the film's whole width, at most at its own size
  view.zoom = Math.min(fitWidth(), 1);
  go(view.row, shown.state.columns / 2);
}
export function start() {
  whole();
  go(canvas.clientHeight / 2 / view.zoom);
}
export function inView({ row, column }) {
  const [x, y] = toScreen(row, column);
  return x >= RULER && y >= 0 && x <= canvas.clientWidth && y <= canvas.clientHeight;
}

// ---- what the server gives: tiles, and the reading of the rows in view
const tiles = new Map(), pending = new Set();
let wanted = [], overlay = null, asking = false, seek = null;

function fetchTiles() {
  while (pending.size < AT_ONCE && wanted.length) {
    const key = wanted.shift();
    if (pending.has(key) || tiles.has(key)) continue;
    pending.add(key);
    fetch(`tile/${key}?token=${token}`)
      .then((answer) => (answer.ok ? answer.blob() : Promise.reject(new Error(key))))
      .then(createImageBitmap)
      .then((image) => { tiles.set(key, image); soon(); })
      .catch(() => {}) // asked for again when it is drawn next
      .finally(() => { pending.delete(key); fetchTiles(); });
  }
}
async function wantOverlay(first, last) {
  const { rows, revision } = shown.state, span = last - first, old = overlay;
  const holds = old && old.revision === revision && old.first <= first && old.last >= last;
  if (asking || last <= first || (holds && (old.whole || view.zoom < 1.5 * old.zoom))) return;
  const from = Math.max(0, Math.floor(first - span / 2)), to = Math.min(rows, Math.ceil(last + span / 2));
  const most = clamp(6 * canvas.clientHeight, 100, 10000); // every row, where the film is shown at its size or so
  asking = true;
  try {
    const data = await (await ask(`overlay?first=${from}&last=${to}&most=${most}`)).json();
    overlay = { ...data, first: from, last: to, revision, zoom: view.zoom, whole: data.rows.length >= to - from };
    soon();
  } catch { /* the next drawing asks again */ } finally { asking = false; }
}
export function columnAt(trace, row) {
  const course = overlay?.courses[trace - 1];
  if (!course || row < overlay.first || row > overlay.last) return null;
  const k = overlay.rows.findIndex((each) => each >= row);
  return course[k] ?? course[k - 1] ?? null;
}
export function tickNear(x, y, within) { // the mark whose tick lies there: its row on a trace
  if (!overlay || shown.bare) return null;
  let best = null;
  for (const mark of overlay.marks) {
    mark.trace_rows.forEach((place, k) => {
      if (!place) return;
      const [tickX, tickY] = toScreen(...place), away = Math.max(Math.abs(tickX - x) / 2, Math.abs(tickY - y));
      if (away <= within && !(best?.away <= away)) best = { row: place[0], column: place[1], trace: k + 1, away };
    });
  }
  return best;
}

// ---- drawing
let drawn = 0;
export function soon() {
  drawn ||= requestAnimationFrame(() => { drawn = 0; if (shown.state) draw(); });
}
const tint = (name) => getComputedStyle(document.documentElement).getPropertyValue(name);
function sized(element, context) {
  const scale = devicePixelRatio, width = Math.round(element.clientWidth * scale), height = Math.round(element.clientHeight * scale);
  if (element.width !== width || element.height !== height) Object.assign(element, { width, height });
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, element.clientWidth, element.clientHeight);
}
function stroke(path, ink, width, { halo = "#fffb", dash = [] } = {}) {
  pen.setLineDash(dash);
  for (const [style, wide] of [[halo, width + 2.5], [ink, width]]) {
    pen.strokeStyle = style;
    pen.lineWidth = wide;
    pen.stroke(path);
  }
  pen.setLineDash([]);
}
const polygon = (points) => new Path2D(`M${points.map((point) => toScreen(...point).join(" ")).join("L")}`);
const corners = ([[a, b], [c, d]]) => [[a, b], [a, d], [c, d], [c, b], [a, b]];
const level = (row, from = toScreen(0, 0)[0], to = toScreen(0, shown.state.columns)[0]) =>
  new Path2D(`M${from} ${toScreen(row, 0)[1]}H${to}`);

function draw() {
  const { rows } = shown.state, width = canvas.clientWidth, height = canvas.clientHeight;
  sized(canvas, pen);
  const first = clamp(toFilm(0, 0)[0], 0, rows), last = clamp(toFilm(0, height)[0], 0, rows);
  if (seek && overlay?.first <= first && overlay.last >= last) { // now it is known where the trace is
    const columns = overlay.courses[seek - 1].filter((column) => column !== null);
    if (columns.length) view.column = columns.reduce((sum, column) => sum + column, 0) / columns.length;
    seek = null;
  }
  pen.save();
  pen.beginPath();
  pen.rect(RULER, 0, width - RULER, height);
  pen.clip();
  drawTiles();
  if (!shown.bare) drawReading();
  if (!shown.bare) shown.state.edits.forEach(drawEdit);
  for (const row of shown.doubt ? [shown.doubt.first_row, shown.doubt.last_row] : []) stroke(level(row), "#a85b00", 2, { dash: [2, 5] });
  if (shown.sketch) drawSketch();
  pen.restore();
  drawRuler(first, last);
  drawStrip(first, last);
  wantOverlay(first, last);
  const stale = overlay?.revision !== shown.state.revision;
  Object.assign(canvas.dataset, { row: view.row, column: view.column, zoom: view.zoom, waiting: wanted.length + pending.size + stale });
  canvas.dispatchEvent(new Event("drawn"));
}

function drawTiles() {
  const { rows, columns, levels } = shown.state, scale = devicePixelRatio;
  const finest = clamp(Math.floor(-Math.log2(view.zoom * scale) + 0.01), 0, levels - 1);
  const [top, left] = toFilm(RULER, 0), [bottom, right] = toFilm(canvas.clientWidth, canvas.clientHeight);
  const [x0, y0] = toScreen(0, 0);
  pen.save();
  pen.beginPath();
  pen.rect(x0, y0, columns * view.zoom, rows * view.zoom);
  pen.clip();
  pen.imageSmoothingEnabled = view.zoom < 3;
  wanted = [];
  const whole = (value) => Math.round(value * scale) / scale;
  for (let level = levels - 1; level >= finest; level--) { // coarser tiles first: they show where a finer one is not there yet
    const size = TILE * 2 ** level, unit = size * view.zoom;
    for (let i = Math.max(0, Math.floor(top / size)); i * size < Math.min(bottom, rows); i++) {
      for (let j = Math.max(0, Math.floor(left / size)); j * size < Math.min(right, columns); j++) {
        const key = `${level}/${i}/${j}`, image = tiles.get(key);
        if (!image && level === finest) wanted.push(key);
        if (!image) continue;
        tiles.delete(key);
        tiles.set(key, image); // lately used ones last
        const x = whole(x0 + j * unit), toX = whole(x0 + (j + image.width / TILE) * unit);
        const y = whole(y0 + i * unit), toY = whole(y0 + (i + image.height / TILE) * unit);
        pen.drawImage(image, x, y, toX - x, toY - y);
      }
    }
  }
  pen.restore();
  for (const key of tiles.keys()) {
    if (tiles.size <= MOST_TILES) break;
    tiles.get(key).close();
    tiles.delete(key);
  }
  fetchTiles();
}

function drawReading() {
  if (!overlay) return;
  const dot = clamp(2.4 * view.zoom, 1.6, 5), x0 = toScreen(0, 0)[0];
  overlay.courses.forEach((course, k) => {
    const path = new Path2D(), ys = overlay.rows.map((row) => toScreen(row, 0)[1]);
    let open = false;
    course.forEach((column, i) => {
      if (column !== null) path[open ? "lineTo" : "moveTo"](x0 + column * view.zoom, ys[i]);
      open = column !== null;
    });
    pen.strokeStyle = pen.fillStyle = colour(k + 1);
    pen.lineWidth = 1;
    pen.stroke(path);
    overlay.read[k].forEach((column, i) => {
      if (column !== null) pen.fillRect(x0 + column * view.zoom - dot / 2, ys[i] - dot / 2, dot, dot);
    });
  });
  for (const mark of overlay.marks) {
    if (view.zoom < TICKS && !mark.minute) continue;
    mark.trace_rows.forEach((place, k) => {
      if (!place) return;
      const [x] = toScreen(...place), half = (mark.minute ? 16 : 9) * clamp(2 * view.zoom, 0.4, 1);
      stroke(level(place[0], x - half, x + half), colour(k + 1), mark.minute ? 3.5 : 2, { halo: "#fff" });
    });
  }
}

let hatch = null;
function hatched(path) {
  if (!hatch) {
    const cell = new OffscreenCanvas(8, 8), line = cell.getContext("2d");
    line.strokeStyle = "#8a1c1ca0";
    line.lineWidth = 1.2;
    for (const shift of [-8, 0, 8]) { line.moveTo(shift, 8); line.lineTo(shift + 8, 0); }
    line.stroke();
    hatch = pen.createPattern(cell, "repeat");
  }
  pen.fillStyle = hatch;
  pen.fill(path);
  stroke(path, "#8a1c1c", 1.5);
}
function dots(points, ink) {
  for (const [row, column] of points) {
    const [x, y] = toScreen(row, column);
    pen.fillStyle = "#fff";
    pen.fillRect(x - 4, y - 4, 8, 8);
    pen.fillStyle = ink;
    pen.fillRect(x - 3, y - 3, 6, 6);
  }
}
const DRAWN = {
  mask: ({ points }) => hatched(polygon(points.length === 2 ? corners(points) : [...points, points[0]])),
  follow({ points, trace }) {
    stroke(polygon(points), colour(trace), 2, { dash: [7, 4] });
    dots(points, colour(trace));
  },
  mark({ row, trace }) {
    const [x, y] = toScreen(row, columnAt(trace, row) ?? 0), path = new Path2D();
    path.arc(x, y, 9, 0, 7);
    stroke(path, colour(trace), 1.5);
  },
  "no-mark"({ row, trace }) {
    const [x, y] = toScreen(row, columnAt(trace, row) ?? 0);
    stroke(new Path2D(`M${x - 6} ${y - 6}l12 12m-12 0 12-12`), "#8a1c1c", 2);
  },
  break: ({ row }) => stroke(level(row), "#8a1c1c", 2, { dash: [12, 6] }),
  ignore({ first_row, last_row, trace }) {
    const { rows, columns } = shown.state, from = (columns * (trace - 0.9)) / shown.state.traces.length;
    const box = [[first_row ?? 0, from], [last_row ?? rows, from + (0.8 * columns) / shown.state.traces.length]];
    pen.fillStyle = `${colour(trace)}2e`;
    pen.fill(polygon(corners(box)));
    stroke(polygon(corners(box)), colour(trace), 1.2);
  },
};
const drawEdit = (edit) => DRAWN[edit.kind]?.({ trace: 1, ...edit });

function drawSketch() {
  const { tool, points, cross, box, grabbed, trace } = shown.sketch, ink = tool === "mask" ? "#8a1c1c" : colour(trace);
  if (tool === "mask" && box) hatched(polygon(corners(box)));
  else if (tool === "ignore" && (box || points.length)) DRAWN.ignore({ first_row: (box ?? points)[0][0], last_row: cross.row, trace });
  else if (tool === "mask" && points.length === 1) stroke(polygon(corners([points[0], [cross.row, cross.column]])), ink, 1.5);
  else if (points.length) stroke(polygon([...points, [cross.row, cross.column]]), ink, 1.5);
  dots(points, ink);
  if (grabbed) {
    const [x] = toScreen(grabbed.row, grabbed.column);
    stroke(level(cross.row, x - 22, x + 22), colour(grabbed.trace), 3, { halo: "#fff" });
  }
  const [x, y] = toScreen(cross.row, cross.column), path = new Path2D(`M${x - 17} ${y}h12m10 0h12M${x} ${y - 17}v12m0 10v12`);
  stroke(path, "#111", 1.5, { halo: "#fff" });
}

function drawRuler(first, last) {
  const height = canvas.clientHeight, used = [];
  pen.fillStyle = tint("--panel");
  pen.fillRect(0, 0, RULER, height);
  pen.fillStyle = tint("--line");
  pen.fillRect(RULER - 1, 0, 1, height);
  for (const doubt of shown.state.doubtful) {
    if (doubt.last_row < first || doubt.first_row > last) continue;
    const top = toScreen(doubt.first_row, 0)[1], size = Math.max(3, (doubt.last_row - doubt.first_row) * view.zoom);
    pen.fillStyle = tint("--doubt");
    pen.globalAlpha = doubt === shown.doubt ? 1 : 0.5;
    pen.fillRect(0, top, doubt === shown.doubt ? 6 : 4, size);
    pen.globalAlpha = 1;
  }
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  const step = STEPS.find((each) => each * rate() * view.zoom >= 16) ?? 0.1;
  const marks = (overlay?.marks ?? []).filter((mark) => mark.row >= first && mark.row <= last);
  for (const minute of [true, false]) { // full minutes first: where labels would touch, they stay
    pen.font = `${minute ? 600 : 400} 11px system-ui, "DejaVu Sans", sans-serif`;
    pen.fillStyle = tint(minute ? "--ink" : "--soft");
    for (const mark of marks) {
      if (mark.minute !== minute) continue;
      const y = toScreen(mark.row, 0)[1], steps = secondsOf(mark.label) / step, named = Math.abs(steps - Math.round(steps)) * step < 0.02;
      if (named || view.zoom >= TICKS) pen.fillRect(RULER - (minute ? 11 : 6), Math.round(y) - (minute ? 1 : 0), minute ? 10 : 5, minute ? 2 : 1);
      if (!named || used.some((other) => Math.abs(other - y) < 15)) continue;
      used.push(y);
      pen.fillText(mark.label, RULER - 14, y);
    }
  }
}
function drawStrip(first, last) {
  const { rows, doubtful, edits } = shown.state, width = strip.clientWidth, unit = strip.clientHeight / rows;
  sized(strip, stripPen);
  const bar = (from, to, ink, x, wide, least) => {
    stripPen.fillStyle = ink;
    stripPen.fillRect(x, from * unit, wide, Math.max(least, (to - from) * unit));
  };
  bar(first, last, `${tint("--accent")}44`, 0, width, 4);
  bar(first, first, tint("--accent"), 0, width, 1.5);
  bar(last, last, tint("--accent"), 0, width, 1.5);
  for (const doubt of doubtful) bar(doubt.first_row, doubt.last_row, tint("--doubt"), 4, 8, 2);
  for (const edit of edits) bar(rowOf(edit), rowOf(edit), tint("--ink"), 15, 7, 2);
}
export const rowOf = (edit) => edit.row ?? edit.points?.[0][0] ?? edit.first_row ?? 0;

strip.addEventListener("pointerdown", (event) => go((event.offsetY / strip.clientHeight) * shown.state.rows));
new ResizeObserver(soon).observe(canvas);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", soon);
