// The G-code: only the lines in sight are in the document, so that a million cost nothing.

const LINE_PX = 18;
const TALLEST_PX = 8e6;

class Listing {
  constructor(place, lines, onPick) {
    Object.assign(this, { place, lines, onPick, chosen: 0, heat: null });
    this.list = place.querySelector("ol");
    this.marked = new Map(head.marked);
    this.height = Math.min(lines.length * LINE_PX, TALLEST_PX);
    place.querySelector(".spacer").style.height = `${this.height}px`;
    place.style.setProperty("--digits", String(lines.length).length);
    place.addEventListener("scroll", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(place);
    this.list.addEventListener("click", (event) => {
      const row = event.target.closest("li");
      if (row) this.onPick(Number(row.dataset.line));
    });
    this.draw();
  }

  // Pixels above the first line that is in sight, if every line had its full height.
  above() {
    const hidden = Math.max(this.lines.length * LINE_PX - this.place.clientHeight, 0);
    const scrolls = Math.max(this.height - this.place.clientHeight, 1);
    return hidden * Math.min(this.place.scrollTop / scrolls, 1);
  }

  draw() {
    const above = this.above(), first = Math.floor(above / LINE_PX);
    const shown = Math.ceil(this.place.clientHeight / LINE_PX) + 1;
    this.list.style.transform = `translateY(${this.place.scrollTop - (above - first * LINE_PX)}px)`;
    const rows = [];
    for (let i = first; i < Math.min(first + shown, this.lines.length); i++) rows.push(this.row(i + 1));
    this.list.replaceChildren(...rows);
  }

  row(line) {
    const row = document.createElement("li");
    row.dataset.line = line;
    row.id = `line-${line}`;
    row.setAttribute("role", "option");
    row.setAttribute("aria-selected", String(line === this.chosen));
    const severity = this.marked.get(line);
    if (severity) {
      row.className = severity;
      row.title = `${severity} in this line`;
    }
    const heat = row.appendChild(document.createElement("span"));
    heat.className = "heat";
    if (this.heat?.has(line)) heat.style.background = this.heat.get(line);
    const number = row.appendChild(document.createElement("span"));
    number.className = "number";
    number.textContent = line;
    row.append(this.lines[line - 1].slice(0, 500));
    return row;
  }

  choose(line) {
    if (line === this.chosen) return;
    this.list.querySelector('[aria-selected="true"]')?.setAttribute("aria-selected", "false");
    this.chosen = line;
    if (line > 0) {
      this.place.setAttribute("aria-activedescendant", `line-${line}`);
      const at = (line - 1) * LINE_PX, above = this.above();
      if (at < above + LINE_PX || at > above + this.place.clientHeight - 2 * LINE_PX) {
        const hidden = Math.max(this.lines.length * LINE_PX - this.place.clientHeight, 1);
        const scrolls = Math.max(this.height - this.place.clientHeight, 1);
        this.place.scrollTop = (Math.max(0, at - this.place.clientHeight / 2) / hidden) * scrolls;
        this.draw();
      }
    }
    byId(`line-${line}`)?.setAttribute("aria-selected", "true");
  }

  setHeat(heat) {
    this.heat = heat;
    this.draw();
  }
}
