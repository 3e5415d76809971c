// The windows for files and for the editor's own scene: save, load, a mesh to add, frame, clutch, tool.

import { type Vec, fromDegrees, toDegrees } from "./frames";
import { CheckField, type Send, TextField, errorLine, make, numberField, over, parse, put, shown } from "./fields";
import { type Condition, type Model, mark } from "./model";
import { type Orders, flat } from "./orders";
import { reason } from "./wire";

function dialog(title: string, ...content: (Node | string)[]): HTMLDialogElement {
  const box = make("dialog", {}, make("h2", { textContent: title }), ...content);
  const close = make("button", { textContent: "Close", type: "button", onclick: () => box.close() });
  box.append(make("div", { className: "buttons" }, close));
  box.onclose = () => box.remove();
  document.body.append(box);
  box.showModal();
  return box;
}

/** A file that the person chooses. */
function chooseFile(accept: string): Promise<File | null> {
  return new Promise((done) => {
    const input = make("input", { type: "file", accept });
    input.onchange = () => done(input.files?.[0] ?? null);
    input.oncancel = () => done(null);
    input.dataset.upload = accept;
    input.hidden = true;
    document.body.append(input);
    input.click();
    setTimeout(() => input.remove(), 60000);
  });
}

/** A mesh from a file that the person chooses; it is uploaded, and then `use` has the server take it. */
export async function askForMesh(orders: Orders, title: (file: string) => string, word: string, use: (scale: number, file: string) => Promise<unknown>): Promise<void> {
  const file = await chooseFile(".obj,.ply,.stl,.off");
  if (!file) return;
  const scale = make("input", { type: "text", value: "1", id: "mesh-scale" });
  const error = errorLine();
  const go = make("button", { textContent: word, className: "primary", id: "mesh-add" });
  const box = dialog(title(file.name), make("label", { className: "inline" }, "One unit of the file, in m ", scale),
    make("p", { className: "hint", textContent: "1 for metres, 0.001 for millimetres" }), error, make("div", { className: "buttons" }, go));
  scale.onkeydown = (event) => { if (event.key === "Enter") go.click(); };
  scale.select();
  go.onclick = async () => {
    const metres = parse(scale.value);
    if (metres === null || metres <= 0) { error.textContent = "a number above 0 is wanted"; return; }
    go.disabled = true;
    try {
      if (!await orders.wire.upload(file, file.name, () => box.open)) return; // the window was closed
      await use(metres, file.name);
      box.close();
    } catch (refused) {
      error.textContent = reason(refused);
      go.disabled = false;
    }
  };
}

export class Dialogs {
  constructor(private readonly model: Model, private readonly orders: Orders) {}

  async save(): Promise<void> {
    const found = await this.orders.ask("files");
    if (!found) return;
    const name = make("input", { type: "text", id: "save-name", value: "scene.json", spellcheck: false });
    const error = errorLine();
    const save = make("button", { textContent: "Save", className: "primary", id: "save-now" });
    const box = dialog("Save the editor's scene",
      make("p", { className: "hint", textContent: `On the server's disk, in ${found.folder}, with its meshes beside it.` }), name, error,
      make("div", { className: "buttons" }, save, make("a", { href: "scene.zip", download: "scene.zip", textContent: "Download as .zip", id: "save-zip", className: "button" })));
    name.select();
    save.onclick = async () => {
      try {
        const done = await this.orders.wire.send("save", { file: name.value });
        this.orders.onNotice(`Saved as ${done.file}.`, false);
        box.close();
      } catch (refused) {
        error.textContent = reason(refused);
      }
    };
    name.onkeydown = (event) => { if (event.key === "Enter") save.click(); };
    name.oninput = () => {
      const file = name.value.endsWith(".json") ? name.value : `${name.value}.json`;
      put(save, (found.files as string[]).includes(file) ? "Replace" : "Save");
    };
    name.oninput(new Event("input"));
  }

  async load(): Promise<void> {
    const found = await this.orders.ask("files");
    if (!found) return;
    const error = errorLine();
    const list = make("div", { className: "files" });
    const upload = make("button", { textContent: "Upload .zip or .json …", id: "load-upload" });
    const box = dialog("Load a scene", make("p", { className: "hint",
      textContent: `Objects of the same name are replaced; others stay. Files in ${found.folder}:` }), list, error, make("div", { className: "buttons" }, upload));
    const load = async (fields: Record<string, unknown>, name: string) => {
      try {
        await this.orders.wire.send("load", fields);
        this.orders.onNotice(`Loaded ${name}.`, false);
        box.close();
      } catch (refused) {
        error.textContent = reason(refused);
      }
    };
    for (const file of found.files as string[]) {
      list.append(make("button", { textContent: file, onclick: () => void load({ file }, file) }));
    }
    if (!found.files.length) list.append(make("p", { className: "hint", textContent: "There is no scene yet." }));
    upload.onclick = async () => {
      const file = await chooseFile(".zip,.json");
      if (!file) return;
      try {
        if (await this.orders.wire.upload(file, file.name, () => box.open)) await load({ upload: true, file: file.name }, file.name);
      } catch (refused) {
        error.textContent = reason(refused);
      }
    };
  }

  addMesh(place: Vec): Promise<void> {
    return askForMesh(this.orders, (file) => `Add ${file}`, "Add", async (scale, file) => {
      const name = file.replace(/\.\w+$/, "").replace(/[/\x00-\x1f]/g, "_").slice(0, 24) || "mesh";
      const back = { kind: "linear_increasing", sense: "attractive", gain: 300, limit: 5 };
      const fields = { "pose.position": place, enabled: false, ...flat("back", back) }; // the hand may be deep inside
      const made = await this.orders.wire.send("add", { name, primitive: "mesh", upload: true, file, scale, fields });
      this.orders.selectWhenThere(made.name);
      this.orders.onNotice(`${made.name} is disabled, as the hand may be inside it: enable it to feel it.`, false);
    });
  }

  /** Frame, clutch and tool of the editor's own scene. */
  scene(): void {
    const own = this.model.clients.get(this.model.me);
    if (!own) return;
    const send = (fields: Record<string, unknown>) => this.orders.wire.send("frame", { fields });
    const frame = () => this.model.ownFrame;
    const body = make("div", { className: "scene-fields" });
    const updates: (() => void)[] = [];
    const add = (field: TextField, show: () => string, to: HTMLElement) => { to.append(field.row); updates.push(() => field.show(show())); };
    const places = make("div", { className: "triple" }), turns = make("div", { className: "triple" });
    (["x", "y", "z"] as const).forEach((name, i) => {
      const sendPlace: Send = (_path, value) => send({ [`position.${name}`]: value });
      add(numberField(`frame.pose.position.${name}`, name, "m", sendPlace), () => shown(frame().pose.position[i]), places);
      const sendTurn: Send = (_path, value) => {
        const degrees = toDegrees(frame().pose.orientation);
        degrees[i] = value as number;
        return send({ orientation: fromDegrees(degrees) });
      };
      add(numberField(`frame.turn.r${name}`, `r${name}`, "°", sendTurn), () => shown(Number(toDegrees(frame().pose.orientation)[i]!.toFixed(6))), turns);
    });
    body.append(over("where its origin lies at the device, m"), places, over("turned about x, then y, then z, degrees"), turns);
    add(numberField("frame.scale", "scale", "m/m", (_path, value) => send({ scale: value }), "Metres of the scene for each metre of the device"), () => shown(frame().scale), body);
    add(numberField("frame.force_scale", "force scale", "×", (_path, value) => send({ force_scale: value })), () => shown(frame().force_scale), body);
    const clutch = new CheckField("clutch", "clutch held: the hand moves, the tool stays", (_path, value) => this.orders.wire.send("clutch", { held: value }));
    body.append(clutch.row);
    updates.push(() => clutch.show(this.model.clients.get(this.model.me)?.held ?? false));
    const tool = make("textarea", { rows: 4, id: "tool-points", spellcheck: false });
    let told = "";
    updates.push(() => { // an undo may change it, but not what is being typed
      const now = this.model.clients.get(this.model.me)?.points.map((p) => p.map(shown).join(", ")).join("\n") ?? told;
      if (now !== told && tool.value === told) tool.value = now;
      told = now;
    });
    const error = errorLine();
    const apply = make("button", { textContent: "Set the tool's points", id: "tool-apply" });
    apply.onclick = async () => {
      const points = tool.value.split("\n").filter((line) => line.trim()).map((line) => line.split(/[,;\s]+/).filter(Boolean).map(parse));
      try {
        if (points.some((p) => p.length !== 3 || p.includes(null))) throw { text: "each line has three numbers: x, y, z in metres" };
        await this.orders.wire.send("tool", { points });
        error.textContent = "";
      } catch (refused) {
        error.textContent = reason(refused);
      }
    };
    const box = dialog("The editor's own scene", make("p", { className: "hint", textContent: "Where this scene lies at the device, how it is turned, and its scale." }), body,
      make("p", { className: "hint", textContent: "Points of the tool, one a line: x, y, z (m, frame of the handle), 1 to 32" }), tool, error, make("div", { className: "buttons" }, apply));
    const update = () => { if (box.open) for (const f of updates) f(); };
    update();
    const timer = setInterval(() => { if (box.open) update(); else clearInterval(timer); }, 200);
  }

  help(): void {
    const keys: [string, string][] = [
      ["Escape", "closes what is open: a menu, a window, a drawing, a field, a list, the filter. Nothing is open: stops all force"],
      ["Shift+Escape", "stops all force, whatever is open; so does the red button"],
      ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"], ["Delete", "removes the selection, or a corner that is active"],
      ["W, E", "move, turn"], ["Q", "axes of the world, or of the object"], ["Ctrl while dragging", "snaps to 10 mm and 5°"], ["F", "fits the view to the selection"],
      ["1, 2, 3, 4", "view from the top, front, side, and slantwise"],
      ["↑ ↓", "in the table: the next object; with Shift as well, with Ctrl without selecting it"],
      ["Ctrl+Space, Ctrl+A", "in the table: selects one more or one less; all that are shown"],
      ["Space, H", "in the table: enables or disables; hides or shows"],
      ["C", "the next corner of a polyline; arrow keys and Page Up and Down move it by 1 mm"], ["↑ ↓ in a field", "the second digit more or less"],
      ["left, right, wheel", "orbit, pan, zoom; on a screen that is touched one finger, two, and pinch"],
    ];
    const looks: [Condition, string][] = [
      ["felt", "full"], ["fading", "translucent"], ["disabled", "grey wires, dashed lines"],
      ["expired", "grey dots, with a cross: the lifetime is over"], ["refused", "red wires or a thin red line, with a warning sign"],
    ];
    const list = (pairs: [string, string][]) =>
      make("dl", {}, ...pairs.flatMap(([term, text]) => [make("dt", { textContent: term }), make("dd", { textContent: text })]));
    const legend = list(looks.map(([condition, text]) => [`${mark[condition]} ${condition}`, text]));
    const box = dialog("Keys", list(keys), make("h2", { textContent: "How objects look" }), legend);
    box.className = "wide";
    box.scrollTop = 0; // the button below has the focus
  }
}
