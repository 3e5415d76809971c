// Puts the page together: the bar at the top, keys, notices, and what is said when something is not there.

import { Corners } from "./corners";
import { CurvePlot } from "./curve_plot";
import { Field, isUnsent, make, put } from "./fields";
import { fromDevice, length } from "./frames";
import { Gizmo } from "./gizmo";
import { type Happened, Model, newtons } from "./model";
import { Orders, flat } from "./orders";
import { Panel } from "./panel";
import { Pencil } from "./pencil";
import { Dialogs } from "./dialogs";
import { Escape } from "./escape";
import { Table } from "./table";
import { soft } from "./profiles";
import { TimePlots } from "./time_plots";
import { View } from "./view";
import { Wire } from "./wire";

const at = (id: string): HTMLElement => document.getElementById(id)!;
const wire = new Wire(), model = new Model(), orders = new Orders(wire, model), dialogs = new Dialogs(model, orders);
wire.onState = (state) => model.take(state);
wire.connect(); // the first state comes while the page is put together

// ---- Notices: the newest three, for a while

orders.onNotice = (text, isBad) => {
  const box = at("notices");
  const notice = make("div", { className: isBad ? "notice bad" : "notice", textContent: text, role: isBad ? "alert" : "status" } as Partial<HTMLDivElement>);
  box.append(notice);
  while (box.children.length > 3) box.firstChild!.remove();
  setTimeout(() => notice.remove(), isBad ? 12000 : 5000);
};
let fault = ""; // what the servo said when it stopped the force
Field.onLate = (text) => orders.onNotice(text, true);
model.on(["happened"], () => {
  for (const event of (model.told.events ?? []) as Happened[]) {
    if (event.kind === "edited") orders.onNotice(`${event.name} was changed by ${event.text}`, false);
    if (event.kind === "refused") orders.onNotice(`${event.name || "a change"} was refused: ${event.text}`, true);
    if (event.kind === "expired") orders.onNotice(`${event.name} has outlived its lifetime`, false);
    // As long as there is no force, the banner says why.
    if (event.kind === "device" && event.value === 0 && fault) orders.onNotice(`${event.name} is back: ${fault}`, false);
    if (event.kind === "device") fault = event.value === 0 ? "" : event.text;
  }
});

// ---- The view, or a sentence where there can be none

function startView(): View | null {
  try {
    return new View(at("view"), model);
  } catch {
    at("view").dataset.webgl = "missing";
    return null;
  }
}
const view = startView();
new Table(at("table"), model, orders);
new Panel(at("panel"), model, orders);
const curve = new CurvePlot(at("curve"), model, orders);
const plots = new TimePlots(at("time"), at("time-bar"), model);

/** Where something new goes: the hand, in the editor's scene, to the millimetre. */
const newPlace = () => fromDevice(model.ownFrame, model.handPlace.map((x) => Math.round(x * 1000) / 1000) as [number, number, number]);

let escape: Escape | undefined;
const tools = view ? startTools(view) : null;
escape = new Escape(() => void orders.stopForce(), () => (tools?.pencil.isOn ? () => tools.pencil.cancel() : null));
function startTools(view: View) {
  const gizmo = new Gizmo(view, model, orders), corners = new Corners(view, model, orders), pencil = new Pencil(view, model, orders);
  let down: { x: number; y: number } | null = null;
  view.canvas.addEventListener("pointerdown", (event) => { down = event.button === 0 && !gizmo.isUnderPointer ? { x: event.clientX, y: event.clientY } : null; });
  view.canvas.addEventListener("pointerup", (event) => {
    if (!down || Math.hypot(event.clientX - down.x, event.clientY - down.y) > 4 || gizmo.isDragging) return;
    if (pencil.isOn) return pencil.click(event.clientX, event.clientY);
    const hit = view.pick(event.clientX, event.clientY);
    const id = hit?.item.told.id;
    if (event.ctrlKey || event.metaKey || event.shiftKey) {
      if (id === undefined) return;
      const next = new Set(model.selected);
      if (!next.delete(id)) next.add(id);
      model.select(next);
    } else {
      model.select(id === undefined ? [] : [id]);
    }
  });
  const buttons = { move: at("tool-move"), turn: at("tool-turn"), space: at("tool-space"), draw: at("tool-draw") };
  gizmo.onChange = () => {
    buttons.move.setAttribute("aria-pressed", String(gizmo.mode === "translate" && !pencil.isOn));
    buttons.turn.setAttribute("aria-pressed", String(gizmo.mode === "rotate" && !pencil.isOn));
    buttons.space.textContent = gizmo.space === "world" ? "World axes" : "Own axes";
  };
  pencil.onChange = () => {
    buttons.draw.setAttribute("aria-pressed", String(pencil.isOn));
    at("drawing").hidden = !pencil.isOn;
    gizmo.away = pencil.isOn;
    for (const button of [buttons.move, buttons.turn, buttons.space]) (button as HTMLButtonElement).disabled = pencil.isOn; // until the line is done
    gizmo.onChange();
    escape?.tell();
  };
  buttons.move.onclick = () => { gizmo.mode = "translate"; };
  buttons.turn.onclick = () => { gizmo.mode = "rotate"; };
  buttons.space.onclick = () => { gizmo.space = gizmo.space === "world" ? "local" : "world"; };
  buttons.draw.onclick = () => (pencil.isOn ? pencil.cancel() : pencil.start());
  at("draw-finish").onclick = () => void pencil.finish(false);
  at("draw-back").onclick = () => pencil.back();
  at("draw-cancel").onclick = () => pencil.cancel();
  at("fit").onclick = () => { if (!gizmo.isDragging) view.fit(); };
  for (const from of ["top", "front", "side", "free"] as const) at(`look-${from}`).onclick = () => view.look(from);
  pencil.cancel();
  return { view, gizmo, corners, pencil };
}

// ---- The bar at the top

const adders: Record<string, () => void> = {
  point: () => void orders.add("point", "point", { "pose.position": newPlace(), ...flat("front", soft(0.04)) }),
  plane: () => void orders.add("plane", "plane", {
    "pose.position": newPlace().map((x, i) => (i === 2 ? x - 0.02 * model.ownFrame.scale : x)),
    ...flat("back", { kind: "linear_increasing", sense: "attractive", gain: 300, limit: 5 }),
  }),
  polyline: () => {
    if (tools) return tools.pencil.start();
    void orders.add("line", "polyline", { "pose.position": newPlace(), shape: { points: [[0, 0, 0], [0.05, 0, 0]], closed: false }, ...flat("front", soft(0.04)) });
  },
  mesh: () => void dialogs.addMesh(newPlace()),
};
for (const [name, add] of Object.entries(adders)) at(`add-${name}`).onclick = add;
at("undo").onclick = () => void orders.step("undo");
at("redo").onclick = () => void orders.step("redo");
at("save").onclick = () => void dialogs.save();
at("load").onclick = () => void dialogs.load();
at("scene").onclick = () => dialogs.scene();
at("help").onclick = () => dialogs.help();
at("remove").onclick = () => remove();
at("recover").onclick = () => void orders.ask("recover");
at("discard").onclick = () => void orders.ask("discard");

for (const menu of document.querySelectorAll<HTMLElement>(".menu")) menu.onclick = () => { if (menu.matches(":popover-open")) menu.hidePopover(); };
const tabs = [...document.querySelectorAll<HTMLElement>("#tabs button")]; // on a narrow screen
for (const tab of tabs) {
  tab.onclick = () => {
    document.body.dataset.tab = tab.dataset.tab;
    for (const one of tabs) one.setAttribute("aria-pressed", String(one === tab));
  };
}
tabs[0]!.click();

function remove(): void {
  const chosen = model.selection;
  const own = chosen.filter((item) => item.told.own).map((item) => item.told.name);
  if (own.length) void orders.remove(own);
  if (own.length < chosen.length) orders.onNotice("Another client's object cannot be removed: disable it.", false);
}

window.addEventListener("keydown", (event) => {
  const target = event.target as HTMLElement;
  const isTyping = target.matches("input:not([type=checkbox]), textarea, select");
  if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") {
    if (isTyping && "defaultValue" in target && isUnsent(target as HTMLInputElement)) return; // the browser undoes what is typed
    event.preventDefault();
    if (tools?.pencil.isOn) return tools.pencil.back(); // of the line that is being drawn
    return void orders.step(event.shiftKey ? "redo" : "undo");
  }
  if (isTyping || event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
  const keys: Record<string, () => void> = {
    Delete: () => { if (!event.repeat && !tools?.corners.removeActive()) remove(); },
    w: () => at("tool-move").click(), e: () => at("tool-turn").click(), q: () => at("tool-space").click(), f: () => at("fit").click(),
    1: () => at("look-top").click(), 2: () => at("look-front").click(), 3: () => at("look-side").click(), 4: () => at("look-free").click(),
    c: () => tools?.corners.step(),
    Enter: () => { if (tools?.pencil.isOn && !target.matches("button")) void tools.pencil.finish(false); },
    "?": () => dialogs.help(),
  };
  keys[event.key.length === 1 ? event.key.toLowerCase() : event.key]?.();
});

// ---- What is told of the server

/** As forceserver's commands have it. */
const serverName = (): string => (model.told.endpoint ?? "").replace(/^shm:/, "").replace(/\?.*/, "");

function updateBar(): void {
  const { told } = model, history = told.history ?? {}, stats = told.stats;
  const held = model.clients.get(model.me)?.held ? ", its clutch held" : "";
  put(at("where"), `${told.endpoint ?? ""}${model.me ? ` as ${model.me}${held}` : ""}`);
  const undo = at("undo") as HTMLButtonElement, redo = at("redo") as HTMLButtonElement;
  undo.disabled = !history.undo || model.viewOnly;
  redo.disabled = !history.redo || model.viewOnly;
  undo.title = history.undo ? `Undo: ${history.undo.text} (${history.undo.who})` : "There is nothing to undo";
  redo.title = history.redo ? `Do again: ${history.redo.text} (${history.redo.who})` : "There is nothing to do again";
  (at("remove") as HTMLButtonElement).disabled = !model.selection.some((item) => item.told.own);
  put(at("force"), model.hand ? newtons(length(model.sent)) : "–");
  const isDampingAlone = model.damping > 0.02 && [...model.clients.values()].every((client) => length(model.forceOf(client)) < 0.02);
  put(at("force-word"), isDampingAlone ? "at the hand: damping" : "at the hand");
  const { isStopped } = model, faults = (stats?.faults ?? []) as string[];
  put(at("servo"), stats ? `${stats.rate?.toFixed(0) ?? "–"} Hz` : "");
  at("servo").title = stats ? `late p99 ${(stats.late_p99 * 1e6).toFixed(0)} µs, ${stats.misses} ticks missed` : "";
  const banner = at("banner"), sentence = model.error ? model.error + (model.isConnected ? ". Waiting for a server …" : "")
    : isStopped ? `All force is stopped. The user of the server lets it return: “forceserver resume ${serverName()}”, or Enter in the terminal of “forceserver run”.`
    : faults.length ? `The servo stopped the force: ${fault || faults.join(", ")}` : "";
  put(banner, sentence);
  if (banner.hidden !== (sentence === "")) banner.hidden = sentence === "";
  document.body.dataset.server = model.error ? "gone" : isStopped ? "stopped" : "there";
  document.body.classList.toggle("view-only", model.viewOnly);
  const offer = told.recovery;
  at("recovery").hidden = !offer || model.viewOnly || Boolean(model.error);
  if (offer) at("recovery-when").textContent = new Date(offer.written * 1000).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" });
}
model.on(["state", "selection"], updateBar);
wire.onLine = (isConnected) => {
  model.isConnected = isConnected;
  if (!isConnected) model.loseAll();
  updateBar();
};
let hasFit = false;
model.on(["state"], () => { if (!hasFit && model.told.device) { hasFit = true; view?.fit(); } });

// For the tests, which drive the page with mouse and keys and look at places in the picture.
Object.assign(window, { editor: { model, view, tools, plots, curve } });
