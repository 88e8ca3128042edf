// One request to the server: its answer, or an Error with one line for the person.

export const token = new URLSearchParams(location.search).get("token");

export async function ask(path, content) {
  const headers = { "X-Token": token };
  const post = { method: "POST", body: JSON.stringify(content), headers: { ...headers, "Content-Type": "application/json" } };
  let answer;
  try {
    answer = await fetch(path, content === undefined ? { headers } : post);
  } catch {
    throw new Error("isochrony does not answer: it has ended, or the tunnel to it is closed. Finished edits are saved.");
  }
  if (answer.ok) return answer;
  const text = await answer.text();
  let line = `isochrony failed (status ${answer.status}); its terminal says why. Finished edits are saved.`;
  try {
    line = JSON.parse(text).error ?? line;
  } catch { /* not an answer of ours: the line stands */ }
  throw new Error(line);
}
