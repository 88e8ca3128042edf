// The time of rows, by the marks: straight from mark to mark, beyond them with the mean slope.

let rows = [], seconds = [], clock = false;

export const secondsOf = (label) => {
  const time = /(\d+):(\d\d):(\d\d(?:\.\d*)?)$/.exec(label);
  return time ? 3600 * time[1] + 60 * time[2] + Number(time[3]) : Number.parseFloat(label.replace("\u2212", "-"));
};
export const rate = () => (rows.at(-1) - rows[0]) / (seconds.at(-1) - seconds[0]); // rows to a second

export function setAxis(marks) {
  [rows, seconds] = [[], []];
  clock = marks.some((mark) => mark.label.includes(":"));
  for (const mark of marks) {
    let time = secondsOf(mark.label);
    if (!Number.isFinite(time)) continue;
    while (clock && time < seconds.at(-1) - 43200) time += 86400; // past midnight
    rows.push(mark.row);
    seconds.push(time);
  }
}
function along(from, to, value) {
  const end = from.length - 1;
  if (end < 1) return null;
  if (value < from[0] || value > from[end]) {
    const near = value < from[0] ? 0 : end;
    return to[near] + ((value - from[near]) * (to[end] - to[0])) / (from[end] - from[0]);
  }
  const k = Math.max(from.findIndex((each) => each >= value), 1);
  return to[k - 1] + ((value - from[k - 1]) * (to[k] - to[k - 1])) / (from[k] - from[k - 1] || 1);
}
export function timeAt(row) {
  const time = along(rows, seconds, row);
  if (time === null) return "";
  if (!clock) return `${time < 0 ? "\u2212" : "+"}${Math.abs(time).toFixed(1)} s`;
  const tenths = ((Math.round(time * 10) % 864000) + 864000) % 864000, two = (n) => String(Math.floor(n)).padStart(2, "0");
  return `${two(tenths / 36000)}:${two((tenths / 600) % 60)}:${two((tenths / 10) % 60)}.${tenths % 10}`;
}
export function rowAt(text) { // of "12:03", "12:03:00.5", "+63.5 s", "row 4000" or "4000"
  const time = /^(\d{1,2}):(\d\d)(?::(\d\d(?:\.\d*)?))?$/.exec(text), passed = /^([+-]?\d+(?:\.\d*)?)\s*s$/.exec(text);
  const row = /^(?:row\s*)?(\d+(?:\.\d*)?)$/i.exec(text);
  if (row) return Number(row[1]);
  if (passed && !clock) return along(seconds, rows, Number(passed[1]));
  if (!time || !clock) return null;
  const day = 3600 * time[1] + 60 * time[2] + Number(time[3] ?? 0);
  return along(seconds, rows, day + 86400 * Math.round((seconds[0] - day) / 86400));
}
