// What the page tells in words and lists: gravity, flags, doubtful places, edits.

import { timeAt } from "./axis.js?token=TOKEN";
import * as film from "./film.js?token=TOKEN";

const { shown, view, clamp } = film;
export const $ = (id) => document.getElementById(id);
export const make = (tag, properties = {}, ...children) => {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
};
const minus = (text) => text.replace("-", "\u2212");
const places = (size, most) => clamp(1 - Math.floor(Math.log10(Math.abs(size) || 1)), 0, most);
export const milligal = (value) => minus(value.toFixed(places(value, 3)));
const signed = (value) => (value > 0 ? "+" : "") + milligal(value);
const gravityText = ({ value_m_s2: value, sigma_mgal: sigma, refining }) =>
  value === null ? (refining ? "\u2026" : "none") : `${value.toFixed(5 + places(sigma ?? 1, 4))} m/s\u00b2`;
export const called = (number) => shown.state.traces.find((each) => each.number === number)?.name ?? number;

export function told() {
  const { gravity } = shown.state;
  if (gravity.value_m_s2 === null) return gravity.refining ? "Gravity is being reduced\u2026" : `No gravity: ${gravity.refused ?? "not determined"}`;
  const sigma = gravity.sigma_mgal === null ? "" : ` \u00b1 ${milligal(gravity.sigma_mgal)} mGal`;
  const change = gravity.change_mgal === null ? "" : `, changed by ${signed(gravity.change_mgal)} mGal`;
  return `Gravity ${gravityText(gravity)}${sigma}${change}${gravity.refining ? "; being reduced anew\u2026" : ""}`;
}
export const say = (text) => { $("message").textContent = text; };
export function refuse(text) {
  $("refusal").firstElementChild.textContent = text;
  $("refusal").hidden = false;
}

export function render(doubt, on) {
  const { name, gravity, reading, doubtful, edits, traces, saved, saved_at: at } = shown.state;
  document.title = `${name} \u2013 reading table`;
  Object.assign($("name"), { textContent: name, title: name });
  const method = gravity.method.split(",")[0];
  $("method").textContent = `gravity${method && ` by ${method}`}${gravity.refining ? ", being reduced anew" : ""}`;
  $("method").title = gravity.method;
  $("gravity").textContent = gravityText(gravity);
  $("sigma").textContent = gravity.sigma_mgal === null ? "" : `\u00b1 ${milligal(gravity.sigma_mgal)} mGal`;
  $("change").textContent = gravity.change_mgal === null ? "\u2013" : `${signed(gravity.change_mgal)} mGal`;
  $("samples").textContent = reading.samples.toLocaleString("en").replaceAll(",", "\u202f");
  $("accepted").textContent = `${(100 * reading.accepted_fraction).toFixed(1)} %`;
  const active = document.activeElement, focused = active?.closest("aside ol"); // lists are written anew: focus stays
  const rank = focused && [...focused.children].indexOf(active.closest("li"));
  const why = { "The film cannot be read": reading.refused, "No gravity": gravity.refused };
  const refused = Object.entries(why).filter(([, words]) => words).map((words) => words.join(": "));
  Object.assign($("refused"), { textContent: refused.join("\n"), hidden: !refused.length });
  $("flags").replaceChildren(...reading.flags.map((flag) => {
    const words = shown.state.flag_words[flag] ?? "";
    return make("button", { type: "button", textContent: flag, title: words, onclick: () => say(`${flag}: ${words}`) });
  }));
  $("doubts").replaceChildren(...doubtful.map((each, k) => {
    const harm = each.harm_mgal === null ? "?" : milligal(each.harm_mgal);
    const shownHarm = make("span", { className: "harm", textContent: harm, title: "what it may do to gravity, mGal" });
    return item(() => on.visit(k), k === doubt, each.time, each.trace, each.what, shownHarm);
  }));
  if (!doubtful.length) $("doubts").append(make("li", { className: "none", textContent: "None." }));
  $("edits").replaceChildren(...edits.map((edit) => {
    const what = make("span", {}, KIND[edit.kind] ?? edit.kind, ...(edit.time ? [` ${edit.time}`] : []));
    const made = [edit.by, edit.at?.slice(0, 16).replace("T", " ")].filter(Boolean).join(", ");
    for (const line of [edit.note, made]) if (line) what.append(make("small", { textContent: line }));
    const row = film.rowOf(edit), when = timeAt(row) || `row ${Math.round(row)}`;
    const visit = () => film.go(row, edit.points?.[0][1] ?? film.columnAt(edit.trace, row) ?? view.column);
    return item(visit, false, when, edit.trace, what);
  }).reverse());
  if (!edits.length) $("edits").append(make("li", { className: "none", textContent: "None yet." }));
  $("count").textContent = edits.length || "";
  $("notes").hidden = !reading.notes.length;
  $("notes").lastElementChild.replaceChildren(...reading.notes.map((text) => make("li", { textContent: text })));
  $("saved").textContent = at ? `saved ${at.slice(11, 19)} in ${saved.split(/[\\/]/).at(-1)}` : "no edits to save";
  $("saved").title = saved;
  if (document.activeElement !== $("who")) $("who").value = shown.state.who;
  if ($("traces").childElementCount !== traces.length) {
    $("traces").replaceChildren(...traces.map(({ number, name: label }) => {
      const told = { title: `trace ${label}, key ${number}`, ariaLabel: `trace ${label}`, ariaKeyShortcuts: String(number) };
      return make("button", { type: "button", onclick: () => on.choose(number), ...told }, chip(number), label);
    }));
    on.choose(1);
  }
  if (focused) (focused.children[rank]?.firstElementChild ?? $("film")).focus();
  film.soon();
}
const KIND = { mask: "mask", follow: "line", mark: "mark", "no-mark": "no mark", break: "break", ignore: "ignored" };
const chip = (number) => {
  const square = make("span", { className: "chip", title: `trace ${called(number)}` });
  square.style.background = film.colour(number);
  return square;
};
function item(onclick, current, when, number, words, ...rest) {
  const parts = [make("span", { className: "when", textContent: when }), make("span", { className: "what" }, words), ...rest];
  if (number) parts.splice(1, 0, chip(number));
  return make("li", {}, make("button", { type: "button", onclick, ariaCurrent: current ? "true" : null }, ...parts));
}
