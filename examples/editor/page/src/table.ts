// The table of all objects, by client. Only the lines that are in sight exist, so thousands of objects cost nothing.

import { make, put } from "./fields";
import { type Item, type Model, mark, newtons, sizeOf } from "./model";
import type { Orders } from "./orders";

const lineHeight = 24;
const letters = { point: "•", polyline: "∿", plane: "▱", mesh: "△" };
type Line = { client: string; count: number } | Item;

export class Table {
  private readonly filter = make("input", { type: "search", placeholder: "Filter by name, client, primitive, state", id: "filter" });
  private readonly scroll = make("div", { className: "scroll", tabIndex: 0 });
  private readonly space = make("div", { className: "space" });
  private lines: Line[] = [];
  private anchor = -1;
  private isDue = false;

  constructor(private readonly box: HTMLElement, private readonly model: Model, private readonly orders: Orders) {
    this.filter.setAttribute("aria-label", "Filter the objects");
    this.scroll.setAttribute("role", "grid");
    this.scroll.setAttribute("aria-multiselectable", "true");
    this.scroll.setAttribute("aria-label", "Objects of all clients");
    const head = make("div", { className: "head line" });
    for (const [text, title] of [["", "shown"], ["", "enabled"], ["object", ""], ["state", ""], ["distance", ""], ["force", ""]] as const) {
      head.append(make("span", { textContent: text, title }));
    }
    this.scroll.append(this.space);
    const metres = make("button", { textContent: "client m", id: "metres", title: "Distances in metres of each object's client, not of the device" });
    metres.setAttribute("aria-pressed", "false");
    metres.onclick = () => {
      model.inClientMetres = !model.inClientMetres;
      metres.setAttribute("aria-pressed", String(model.inClientMetres));
      model.tell("rows");
    };
    box.append(make("div", { className: "above" }, this.filter, metres), head, this.scroll);
    this.filter.oninput = () => this.sort();
    this.scroll.onscroll = () => this.draw();
    this.scroll.onkeydown = (event) => this.key(event);
    this.space.onclick = (event) => this.click(event);
    model.on(["objects"], () => this.sort());
    model.on(["selection"], () => { this.draw(); this.reveal(); });
    model.on(["rows", "state"], () => this.later());
    new ResizeObserver(() => this.draw()).observe(this.scroll);
  }

  /** The numbers change with every state: five times a second can be read. */
  private later(): void {
    if (this.isDue) return;
    this.isDue = true;
    setTimeout(() => { this.isDue = false; this.draw(); }, 200);
  }

  private sort(): void {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const groups = new Map<string, Item[]>();
    for (const client of [this.model.me, ...this.model.clients.keys()]) groups.set(client, []);
    for (const item of this.model.items.values()) {
      const text = `${item.told.name} ${item.told.client} ${item.told.primitive} ${item.condition}`.toLowerCase();
      if (!words.every((word) => text.includes(word))) continue;
      if (!groups.has(item.told.client)) groups.set(item.told.client, []);
      groups.get(item.told.client)!.push(item);
    }
    this.lines = [];
    const order = new Intl.Collator("en", { numeric: true });
    for (const [client, items] of groups) {
      if (!items.length && (words.length || client === "server")) continue;
      items.sort((a, b) => order.compare(a.told.short, b.told.short));
      this.lines.push({ client, count: items.length }, ...items);
    }
    this.box.dataset.count = String(this.model.items.size);
    this.draw();
  }

  private draw(): void {
    this.space.style.height = `${this.lines.length * lineHeight}px`;
    const first = Math.max(0, Math.floor(this.scroll.scrollTop / lineHeight) - 2);
    const last = Math.min(this.lines.length, first + Math.ceil(this.scroll.clientHeight / lineHeight) + 5);
    const wanted = last - first;
    while (this.space.children.length > wanted) this.space.lastChild!.remove();
    while (this.space.children.length < wanted) this.space.append(make("div", { className: "line" }));
    for (let i = first; i < last; ++i) this.drawLine(this.space.children[i - first] as HTMLElement, this.lines[i]!, i);
  }

  private drawLine(element: HTMLElement, line: Line, index: number): void {
    element.style.transform = `translateY(${index * lineHeight}px)`;
    element.dataset.index = String(index);
    const html = (text: string) => text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
    if ("count" in line) {
      const colour = `#${this.model.colourOf(line.client).toString(16).padStart(6, "0")}`;
      const client = this.model.clients.get(line.client);
      const locked = client?.locked && line.client !== this.model.me ? " 🔒" : "";
      const own = line.client === this.model.me ? " (this editor)" : "";
      element.className = "line group";
      set(element, `<b style="--c:${colour}">${html(line.client)}</b><i>${own}${locked}</i><span class="sum">${line.count} · ${
        newtons(client ? sizeOf(client.force) : 0)}</span>`);
      element.removeAttribute("aria-selected");
      delete element.dataset.name;
      return;
    }
    const { told } = line, condition = line.condition, isHidden = this.model.hidden.has(told.id);
    const isSelected = this.model.selected.has(told.id);
    element.className = `line item${isSelected ? " selected" : ""}${isHidden ? " hidden" : ""}`;
    element.setAttribute("role", "row");
    element.setAttribute("aria-selected", String(isSelected));
    element.dataset.name = told.name;
    element.dataset.state = condition;
    const near = Number.isFinite(line.distance);
    set(element, `<button class="eye" title="${isHidden ? "Show" : "Hide"}">${isHidden ? "◌" : "◉"}</button>` +
      `<input type="checkbox" class="on" title="Enabled" ${told.enabled ? "checked" : ""} ${line.isLocked ? "disabled" : ""}>` +
      `<span class="name" title="${html(told.name)}"><i>${letters[told.primitive]}</i> <bdi>${html(told.short)}</bdi></span>` +
      '<span class="state"></span><span class="number"></span><span class="number"></span>');
    // What changes all the time, without making the rest anew: a click on the rest may be half done.
    const [state, distance, force] = [...element.children].slice(3) as HTMLElement[];
    state!.className = `state ${condition}`;
    put(state!, `${mark[condition]} ${condition}`);
    put(distance!, near ? this.model.distance(line) : "–");
    put(force!, near ? newtons(sizeOf(line.push)) : "–");
  }

  private click(event: MouseEvent): void {
    const target = event.target as HTMLElement;
    const line = target.closest<HTMLElement>(".line");
    const index = Number(line?.dataset.index ?? -1), item = this.lines[index];
    if (!item || "count" in item) return;
    if (target.classList.contains("eye")) return this.model.setHidden(item.told.id, !this.model.hidden.has(item.told.id));
    if (target.classList.contains("on")) {
      const enabled = (target as HTMLInputElement).checked;
      (line as HTMLElement & { told?: string }).told = undefined;
      return this.setEnabled([item], enabled);
    }
    const id = item.told.id;
    if (event.shiftKey && this.anchor >= 0) {
      const [from, to] = [Math.min(index, this.anchor), Math.max(index, this.anchor)];
      this.model.select(this.lines.slice(from, to + 1).flatMap((each) => ("count" in each ? [] : [each.told.id])));
    } else if (event.ctrlKey || event.metaKey) {
      const next = new Set(this.model.selected);
      if (!next.delete(id)) next.add(id);
      this.model.select(next);
      this.anchor = index;
    } else {
      this.model.select([id]);
      this.anchor = index;
    }
  }

  private key(event: KeyboardEvent): void {
    const step = { ArrowDown: 1, ArrowUp: -1, PageDown: 10, PageUp: -10 }[event.key];
    const now = this.lines.findIndex((line) => !("count" in line) && this.model.selected.has(line.told.id));
    if (event.target !== this.scroll && event.key === " ") return; // on a button or checkbox of a line
    if (event.key === " " && now >= 0) {
      this.setEnabled(this.model.selection, !(this.lines[now] as Item).told.enabled);
    } else if (step) {
      let next = Math.max(0, Math.min(this.lines.length - 1, now + step));
      while (this.lines[next] && "count" in this.lines[next]!) next += Math.sign(step);
      const item = this.lines[next];
      if (item && !("count" in item)) this.model.select([item.told.id]);
    } else return;
    event.preventDefault();
  }

  /** All of them in one go. */
  private setEnabled(items: Item[], enabled: boolean): void {
    const names = items.filter((item) => !item.isLocked).map((item) => item.told.name);
    this.orders.change(names, { enabled }).catch((refused) => this.orders.onNotice(refused.text, true));
  }

  private reveal(): void {
    const index = this.lines.findIndex((line) => !("count" in line) && this.model.selected.has(line.told.id));
    if (index < 0 || this.model.selected.size !== 1) return;
    const top = index * lineHeight, { scrollTop, clientHeight } = this.scroll;
    if (top < scrollTop) this.scroll.scrollTop = top;
    else if (top + lineHeight > scrollTop + clientHeight) this.scroll.scrollTop = top + lineHeight - clientHeight;
  }
}

/** Only where it differs: else a click that is half done would be lost. */
function set(element: HTMLElement & { told?: string }, text: string): void {
  if (element.told === text) return;
  element.told = text;
  element.innerHTML = text;
}
