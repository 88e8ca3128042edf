// The reading table: tools, mouse and keys. The session at the server reads; this page shows and asks.

import { ask } from "./ask.js?token=TOKEN";
import { rowAt, setAxis, timeAt } from "./axis.js?token=TOKEN";
import * as film from "./film.js?token=TOKEN";
import { $, called, harmText, make, refuse, render, say, told } from "./panels.js?token=TOKEN";

const { view, shown, clamp } = film;
const canvas = $("film");
const TOOLS = { // key, name, hint; N stands for the trace
  mask: ["m", "Mask", "Drag a rectangle, or click corners and finish. Nothing is read inside."],
  follow: ["d", "Line", "Click points along trace N from above to below, then finish. Backspace removes the last."],
  mark: ["k", "Mark", "Click where a mark lies on trace N. Its clock time, where known, sets all times."],
  move: ["v", "Move", "Drag a mark's tick along its trace; or click it, then where it belongs."],
  "no-mark": ["x", "No mark", "Click the tick of what was taken for a mark and is none."],
  break: ["b", "Break", "Click the row at which it is not known how many marks passed."],
  ignore: ["i", "Ignore", "Drag over the rows on which trace N is not to be read, or click the first and the last."],
};
const IDLE = "Drag to move, wheel to zoom. A mark is moved by its tick. Choose a tool to correct the reading.";
const DRAGGED = ["mask", "ignore"], CLICKED = 4; // px that a click may move
let timer = 0, naming = null, busy = false, changes = 0, tool = null, trace = 1, points = [], grabbed = null, drag = null, doubt = -1;
const cut = (value) => Math.round(value * 10) / 10; // px
let cross = null; // the crosshair, on the film
let stepped = false; // whether keys moved it since the last point: then Enter sets one, otherwise Enter finishes

// ---- to and from the server
function take(state, words) {
  const old = shown.state, refined = old?.gravity.refining && !state.gravity.refining;
  if (!words && JSON.stringify(old) === JSON.stringify(state)) return later();
  shown.state = state;
  if (!old) film.start();
  if (old?.revision !== state.revision) times();
  const same = (each) => each.first_row === shown.doubt?.first_row && each.trace === shown.doubt?.trace;
  doubt = state.doubtful.findIndex(same);
  shown.doubt = state.doubtful[doubt] ?? null;
  show();
  setBusy(state.busy);
  if (words || refined) say((words ?? "Reduced anew. ") + told());
  later();
}
function later() { // ask again, while another window edits or a better gravity is under way
  const { busy: other, gravity } = shown.state;
  clearTimeout(timer);
  if (other || gravity.refining) timer = setTimeout(refresh, 1000);
}
const show = () => render(doubt, { visit, choose });
const attempt = (work) => () => work().catch((fault) => refuse(fault.message));
const times = attempt(async () => {
  setAxis(await (await ask("times")).json());
  show();
});
const refresh = attempt(async () => {
  if (busy && !shown.state?.busy) return; // an edit of this window brings its own state
  const turn = changes, state = await (await ask("state")).json();
  if (turn === changes) take(state); // otherwise it is of before a change
});
async function change(path, content, words) {
  if (busy) return false;
  changes += 1;
  setBusy(true);
  try {
    await naming; // the name goes with the edit
    const state = await (await ask(path, content)).json();
    setBusy(false);
    take(state, words);
    return true;
  } catch (fault) {
    setBusy(false);
    say("");
    refuse(fault.message);
    return false;
  }
}
async function send(edits, words) { // what is drawn stays where the edit is refused, so that it can be mended
  const more = { ...($("note").value.trim() && { note: $("note").value.trim() }) };
  if (await change("edits", { edits: edits.map((edit) => ({ ...edit, ...more })) }, `${words}. `)) clear();
}
const undo = () => shown.state.can_undo && change("undo", {}, "Undone. ");
const redo = () => shown.state.can_redo && change("redo", {}, "Done again. ");

function setBusy(now) {
  busy = now;
  $("spinner").hidden = !now;
  $("table").ariaBusy = String(now);
  const lost = document.activeElement?.closest("#tools, #options");
  for (const id of ["tools", "options", "done"]) $(id).disabled = now;
  if (now && lost) canvas.focus();
  if (now) say("Reading anew\u2026");
  $("undo").disabled = !shown.state?.can_undo;
  $("redo").disabled = !shown.state?.can_redo;
}

// ---- doubtful places and traces
function visit(k) {
  const { doubtful } = shown.state;
  if (!doubtful.length) return;
  doubt = (k + doubtful.length) % doubtful.length;
  const place = (shown.doubt = doubtful[doubt]);
  film.showRows(place.first_row, place.last_row, place.trace);
  centre();
  [...$("doubts").children].forEach((node, i) => { node.firstElementChild.ariaCurrent = i === doubt ? "true" : null; });
  $("doubts").children[doubt].scrollIntoView({ block: "nearest" });
  const harm = place.harm_mgal === null ? "harm not known" : `${harmText(place.harm_mgal)} mGal`;
  const on = place.trace ? `, trace ${called(place.trace)}` : "";
  say(`Doubtful place ${doubt + 1} of ${doubtful.length}, ${place.time}${on}: ${place.what}, ${harm}`);
}
function choose(number) {
  if (!shown.state.traces.some((each) => each.number === number)) return;
  trace = number;
  [...$("traces").children].forEach((node, k) => { node.ariaPressed = String(shown.state.traces[k].number === number); });
  sketch();
}

// ---- tools
function sketch() {
  const [, name, hint] = TOOLS[tool] ?? [];
  shown.sketch = tool || grabbed ? { tool, points, cross, box: drag?.box, grabbed, trace } : null;
  for (const each of Object.keys(TOOLS)) $(`tool-${each}`).ariaPressed = String(each === tool);
  canvas.style.cursor = tool ? "crosshair" : "";
  if (tool) $("hint").replaceChildren(make("b", { textContent: `${name}. ` }), hint.replace("trace N", `trace ${called(trace)}`));
  else $("hint").textContent = IDLE;
  $("note-field").hidden = $("cancel").hidden = !tool;
  $("time-field").hidden = tool !== "mark";
  $("whole").hidden = tool !== "ignore";
  $("finish").hidden = !["mask", "follow"].includes(tool);
  film.soon();
}
function pick(name) {
  if (busy) return;
  const again = tool === name;
  clear();
  if (again) return;
  tool = name;
  cross = { row: view.row, column: view.column };
  stepped = true;
  sketch();
  canvas.focus();
  say("");
}
function clear() {
  tool = grabbed = drag = null;
  points = [];
  $("note").value = $("time").value = "";
  sketch();
}
function cancel() {
  if (!$("refusal").hidden) $("refusal").hidden = true;
  else if (drag || grabbed || points.length) { drag = grabbed = null; points = []; sketch(); }
  else { clear(); say(""); }
  canvas.focus();
}
function click() { // at the crosshair, by mouse or Enter
  if (busy) return;
  const at = [cut(cross.row), cut(cross.column)], last = points.at(-1), [x, y] = film.toScreen(...at);
  const same = last && Math.hypot(at[0] - last[0], at[1] - last[1]) * view.zoom < CLICKED;
  stepped = false;
  if (tool === "break") send([{ kind: "break", row: at[0] }], "Break set");
  else if (tool === "mark") {
    const time = $("time").value.trim();
    send([{ kind: "mark", row: at[0], trace, ...(time && { time }) }], "Mark set");
  } else if (tool === "no-mark") {
    const tick = film.tickNear(x, y, 14);
    send([{ kind: "no-mark", row: cut(tick?.row ?? at[0]), trace: tick?.trace ?? trace }], "Mark removed");
  } else if (tool === "move" && !grabbed) {
    grabbed = film.tickNear(x, y, 14);
    say(grabbed ? `Mark on trace ${called(grabbed.trace)} taken: click where it belongs` : "No mark here: its tick must be in view, zoom in");
    sketch();
  } else if (tool === "move") drop();
  else if (same) finish();
  else if (tool) {
    points.push(at);
    say(`Point ${points.length} at row ${at[0]}, column ${at[1]}`);
    if (tool === "ignore" && points.length === 2) finish();
    sketch();
  }
}
function drop() { // the mark in hand, at the crosshair's row
  const { row, trace: number } = grabbed;
  const here = (edit) => edit.kind === "mark" && edit.time && (edit.trace ?? 1) === number && Math.abs(edit.row - row) < 2;
  const known = shown.state.edits.findLast(here); // a clock time moves with its mark
  const mark = { kind: "mark", row: cut(cross.row), trace: number, ...(known && { time: known.time }) };
  send([{ kind: "no-mark", row: cut(row), trace: number }, mark], "Mark moved");
}
function finish() {
  if (busy) return;
  if (points.length < 2) return say("At least two points are needed");
  const sorted = [...points].sort(([a], [b]) => a - b);
  if (tool === "mask") send([{ kind: "mask", points }], "Mask set");
  else if (tool === "follow") send([{ kind: "follow", trace, points: sorted }], "Line set");
  else send([{ kind: "ignore", trace, first_row: sorted[0][0], last_row: sorted[1][0] }], `Trace ${called(trace)} ignored there`);
}
function where() {
  const { row, column } = cross ?? view, time = timeAt(row);
  $("place").textContent = `${time && `${time}   `}row ${row.toFixed(0)}, column ${column.toFixed(0)}   ${(100 * view.zoom).toPrecision(2) * 1} %`;
}
function centre() { // the crosshair, where the view has moved away from it
  if (!tool) cross = null;
  else if (!cross || !film.inView(cross)) cross = { row: view.row, column: view.column };
  sketch();
}
function step(x, y, big) {
  stepped = true;
  const by = (big ? 40 : 2) / view.zoom, { rows, columns } = shown.state;
  cross = { row: clamp(cross.row + y * by, 0, rows), column: clamp(cross.column + x * by, 0, columns) };
  const [atX, atY] = film.toScreen(cross.row, cross.column), edge = 30;
  const over = (at, low, high) => Math.min(0, at - low - edge) + Math.max(0, at - high + edge);
  film.pan(over(atX, film.RULER, canvas.clientWidth), over(atY, 0, canvas.clientHeight));
  sketch();
}

// ---- mouse
function point(row, column) {
  cross = { row: clamp(row, 0, shown.state.rows), column: clamp(column, 0, shown.state.columns) };
  stepped = false;
}
canvas.addEventListener("pointerdown", (event) => {
  canvas.focus();
  canvas.setPointerCapture(event.pointerId);
  const { offsetX: x, offsetY: y, button } = event, at = film.toFilm(x, y);
  point(...at);
  const tick = button === 0 && (!tool || (tool === "move" && !grabbed)) && !busy && view.zoom >= film.TICKS && film.tickNear(x, y, 6);
  drag = { x, y, at, last: [x, y], far: false, tick, box: null, boxed: button === 0 && DRAGGED.includes(tool) && !points.length, button };
});
canvas.addEventListener("pointermove", (event) => {
  const { offsetX: x, offsetY: y } = event, [row, column] = film.toFilm(x, y);
  if (event.movementX || event.movementY || drag) point(row, column); // not where the page moves below the mouse
  if (drag) {
    drag.far ||= Math.hypot(x - drag.x, y - drag.y) >= CLICKED;
    if (drag.far && drag.tick) grabbed = drag.tick;
    else if (drag.far && drag.boxed) drag.box = [drag.at.map(cut), [cut(cross.row), cut(cross.column)]];
    else if (drag.far) film.pan(drag.last[0] - x, drag.last[1] - y);
    drag.last = [x, y];
  } else if (!tool) canvas.style.cursor = view.zoom >= film.TICKS && film.tickNear(x, y, 6) ? "ns-resize" : "";
  if (tool || grabbed) sketch();
  else where();
});
canvas.addEventListener("pointerup", () => {
  const done = drag;
  drag = null;
  if (!done) return;
  if (done.far && grabbed && done.tick) drop();
  else if (done.box) { points = done.box; finish(); }
  else if (!done.far && done.button === 0 && tool) click();
});
canvas.addEventListener("pointercancel", cancel);
canvas.addEventListener("pointerleave", () => { if (!tool && !drag) { cross = null; where(); } });
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (event.shiftKey) film.pan(0, event.deltaY || event.deltaX);
  else film.zoomBy(Math.exp(-clamp(event.deltaY * (event.ctrlKey ? 0.01 : 0.0015), -0.7, 0.7)), event.offsetX, event.offsetY);
}, { passive: false });
canvas.addEventListener("drawn", where);

// ---- keys
const move = (x, y) => ({ shiftKey: big }) => (tool ? step(x, y, big) : film.pan(x * (big ? 400 : 60), y * (big ? 400 : 60)));
const page = (by) => () => film.pan(0, by * 0.9 * canvas.clientHeight);
const toggle = () => {
  shown.bare = !shown.bare;
  $("overlay").ariaPressed = String(!shown.bare);
  say(shown.bare ? "Bare film" : "Reading shown");
  film.soon();
};
const zoom = (by) => () => film.zoomBy(by);
const ON_FILM = {
  Enter() {
    if (!tool) return;
    if (["mask", "follow"].includes(tool) && points.length && !stepped) finish();
    else click();
  },
  Backspace() { if (points.pop()) { stepped = true; sketch(); } },
};
const meant = (hint) => hint.replace("trace N", "the chosen trace");
const HELP = [ // keys as they are called, what they do, and how
  ["\u2190 \u2191 \u2192 \u2193", "move over the film; with a tool, move the crosshair. Shift: bigger steps",
    { ArrowUp: move(0, -1), ArrowDown: move(0, 1), ArrowLeft: move(-1, 0), ArrowRight: move(1, 0) }],
  ["PageUp PageDown Home End", "a view up or down; begin, end of the film",
    { PageUp: page(-1), PageDown: page(1), Home: () => film.go(0), End: () => film.go(shown.state.rows) }],
  ["+ \u2212 0", "zoom; whole width. Mouse: wheel, Shift + wheel moves",
    { "+": zoom(1.25), "=": zoom(1.25), "-": zoom(0.8), 0: film.whole }],
  ["g", "go to a time or a row", { g: () => $("where").select() }],
  ["n p", "next, previous doubtful place", { n: () => visit(doubt + 1), p: () => visit(doubt < 0 ? -1 : doubt - 1) }],
  ["o", "reading on, off: compare with the bare film", { o: toggle }],
  ["1 \u2026 9", "trace that is meant", Object.fromEntries([1, 2, 3, 4, 5, 6, 7, 8, 9].map((k) => [k, () => choose(k)]))],
  ...Object.entries(TOOLS).map(([tool, [key, name, hint]]) => [key, `${name}. ${meant(hint)}`, { [key]: () => pick(tool) }]),
  ["Enter", "click at the crosshair; once more at the same place: finish"],
  ["Backspace", "remove the last point"],
  ["t", "clock time of a mark", { t: () => tool === "mark" && $("time").select() }],
  ["Esc", "cancel; close a message; from a field back to the film", { Escape: cancel }],
  ["u Ctrl+Z", "undo", { u: undo, "Ctrl+z": undo }],
  ["r Ctrl+Y", "redo", { r: redo, "Ctrl+y": redo, "Ctrl+Z": redo }],
  ["?", "these keys", { "?": () => $("help").showModal() }],
];
const KEYS = Object.assign({}, ...HELP.map(([, , keys]) => keys));
document.addEventListener("keydown", (event) => {
  if (event.altKey || $("help").open || !shown.state) return;
  if (event.target.matches("input")) {
    if (event.key !== "Escape" && !(event.key === "Enter" && event.target.closest("#options"))) return;
    event.preventDefault();
    canvas.focus();
    return;
  }
  const key = (event.ctrlKey || event.metaKey ? "Ctrl+" : "") + event.key;
  const own = event.target.matches("button, summary"); // they are pressed by Enter themselves
  const act = KEYS[key] ?? (own ? null : ON_FILM[key]);
  if (!act) return;
  event.preventDefault();
  act(event);
  centre();
});

// ---- the page put together
for (const [keys, words] of HELP) {
  const caps = keys.split(" ").flatMap((key) => [make("kbd", { textContent: key }), " "]);
  $("keys").append(make("span", {}, ...caps), make("div", { textContent: words }));
}
function button(id, words, key, onclick, more = {}) {
  const cap = make("kbd", { textContent: key, ariaHidden: "true" });
  $("tools").append(make("button", { id, type: "button", onclick, ariaKeyShortcuts: key, ...more }, `${words} `, cap));
}
const gap = () => make("span", { className: "gap" });
for (const [name, [key, words, hint]] of Object.entries(TOOLS)) {
  button(`tool-${name}`, words, key, () => pick(name), { title: meant(hint), ariaPressed: "false" });
}
$("tools").append(gap(), make("span", { id: "traces", className: "trace" }), gap());
button("undo", "Undo", "u", undo);
button("redo", "Redo", "r", redo);
button("overlay", "Reading", "o", toggle, { ariaPressed: "true", title: "lay the reading over the film" });
$("finish").onclick = finish;
$("cancel").onclick = () => { clear(); canvas.focus(); };
$("whole").onclick = () => send([{ kind: "ignore", trace }], `Trace ${called(trace)} ignored`);
$("refusal").lastElementChild.onclick = cancel;
$("help-button").onclick = () => $("help").showModal();
$("go").onsubmit = (event) => {
  event.preventDefault();
  const row = rowAt($("where").value.trim());
  const like = timeAt(view.row) || "row 4000";
  if (row === null) return refuse(`"${$("where").value}" is neither a time of this film nor a row; write it as ${like}`);
  film.go(row);
  canvas.focus();
  centre();
};
const sendName = attempt(() => ask("who", { who: $("who").value }));
$("who").onchange = () => { naming = sendName(); };
$("csv").onclick = attempt(async () => {
  const href = URL.createObjectURL(await (await ask("readings.csv")).blob());
  const link = make("a", { href, download: `${shown.state.name.replace(/(\.film)?\.\w+$/, "")}.readings.csv` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(href), 60000);
  say(`Readings saved as ${link.download}`);
});
$("done").onclick = attempt(async () => {
  const { saved } = await (await ask("done", {})).json();
  shown.state = null; // nothing more is drawn, nothing asked
  changes += 1;
  clearTimeout(timer);
  const textContent = `The table is closed; the edits are in ${saved}. This page may be closed too.`;
  document.body.replaceChildren(make("p", { className: "end", role: "status", textContent }));
});
addEventListener("focus", () => { if (shown.state && !busy) refresh(); });
refresh();
