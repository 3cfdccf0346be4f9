// Sorting and filtering: the rows are there already, with a key a column; they are moved, never made.
"use strict";

const byId = (id) => document.getElementById(id);
const keys = JSON.parse(byId("keys").textContent);
const body = byId("parts").tBodies[0];
const rows = Array.from(body.rows, (element, number) => ({ element, number, text: null }));
const heads = Array.from(byId("parts").querySelectorAll("th button"));

// What is not known stands last in either direction; equal rows keep the order of the names.
function sortBy(name, direction) {
  const key = keys[name];
  const order = rows.slice().sort((a, b) => {
    const first = key[a.number], second = key[b.number];
    if (first === null || second === null) return (first === null) - (second === null) || keys.part[a.number] - keys.part[b.number];
    return direction * (first - second) || keys.part[a.number] - keys.part[b.number];
  });
  const sorted = document.createDocumentFragment();
  for (const row of order) sorted.append(row.element);
  body.append(sorted);
}

function pick(button) {
  const head = button.parentElement;
  const direction = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
  for (const other of heads) other.parentElement.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", direction === 1 ? "ascending" : "descending");
  sortBy(button.dataset.column, direction);
}

// Every word must be somewhere in the row.
function filter() {
  const words = byId("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
  let count = 0;
  for (const row of rows) {
    row.text ??= row.element.textContent.toLowerCase();
    const isShown = words.every((word) => row.text.includes(word));
    row.element.classList.toggle("hidden", !isShown);
    count += isShown;
  }
  byId("shown").textContent = `${count.toLocaleString("en")} of ${rows.length.toLocaleString("en")}`;
}

for (const button of heads) button.addEventListener("click", () => pick(button));
byId("filter").addEventListener("input", filter);
filter();
