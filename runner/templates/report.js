"use strict";
// The table of runs: filtered by words, sorted by the buttons in its head, and no longer than one wants to look at.
const MORE = 500;  // rows, at each press of the button: a browser takes a second to lay out some thousand
const {rows, recorded, view} = JSON.parse(document.getElementById("data").textContent);
const table = document.getElementById("table"), body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
const filter = document.getElementById("filter"), count = document.getElementById("count"), more = document.getElementById("more");
const texts = rows.map(cells => cells.join(" ").toLowerCase());
const collator = new Intl.Collator("en", {numeric: true});
let order = rows.map((_, index) => index), shown = 200;

function make(tag, look, text, parent) {
  const element = document.createElement(tag);
  element.className = look;
  element.textContent = text;
  parent.append(element);
  return element;
}

function line(index) {
  const [run, status, ...others] = rows[index], row = document.createElement("tr"), head = make("th", "", "", row);
  head.scope = "row";
  if (recorded[index]) {
    const button = make("button", "copy", "Copy", head);
    button.type = "button";
    button.dataset.copy = `${view} ${/^[\w.+-]+$/.test(run) ? run : `'${run.replaceAll("'", "'\\''")}'`}`;
    button.setAttribute("aria-label", `Copy the command that opens ${run}`);
  }
  const name = make("code", "", "", head), cut = run.lastIndexOf("-") + 1;
  make("span", "", run.slice(0, cut), name);
  name.append(run.slice(cut));
  make("span", `status ${status}`, status, make("td", "", "", row));
  others.forEach((text, column) => make("td", heads[column + 2].className, text, row));
  return row;
}

function show() {
  const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
  const found = order.filter(index => words.every(word => texts[index].includes(word)));
  body.replaceChildren(...found.slice(0, shown).map(line));
  count.textContent = `${found.length} of ${rows.length} runs` + (shown < found.length ? `, the first ${shown} shown` : "");
  more.hidden = shown >= found.length;
}

function sort(head) {
  const column = heads.indexOf(head), number = "number" in head.dataset, down = head.getAttribute("aria-sort") === "ascending";
  const keys = rows.map(cells => number ? parseFloat(cells[column]) : cells[column]);
  const empty = key => key === "" || Number.isNaN(key);
  order.sort((a, b) => {
    const [x, y] = [keys[a], keys[b]];
    if (empty(x) || empty(y)) return empty(x) - empty(y);  // at the end, either way
    return (down ? -1 : 1) * (number ? x - y : collator.compare(x, y));
  });
  for (const each of heads) each.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  show();
}

async function copy(command) {
  const toast = document.getElementById("toast");
  try {
    await navigator.clipboard.writeText(command);
    toast.textContent = `Copied: ${command}`;
  } catch {  // a browser that lets no file write to the clipboard
    toast.textContent = command;
  }
  clearTimeout(copy.timer);
  copy.timer = setTimeout(() => { toast.textContent = ""; }, 10000);
}

table.tHead.addEventListener("click", event => event.target.closest("button") && sort(event.target.closest("th")));
body.addEventListener("click", event => event.target.dataset.copy && copy(event.target.dataset.copy));
filter.addEventListener("input", show);
more.addEventListener("click", () => { shown += MORE; show(); });
show();
