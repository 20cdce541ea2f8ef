// The form: a control for each field, made from what fields.js knows. A control that was not
// touched is unset, shows the default and sends nothing.
import { el } from "./dom.js";
import { group_fields } from "./fields.js";

const SLIDER_STEPS = 1000;

// How far a slider's thumb stands for a value: straight where the range is short, else evenly in
// the logarithm above a floor, so that 1.7 m and 400 km are both within reach.
function slider_scale(field) {
	const { min, max } = field;
	if (max - min <= 720)
		return { to: v => (v - min) / (max - min), from: t => min + t * (max - min), digits: max - min > 2 ? 1 : 3 };
	const floor = Math.max(min, Math.abs(Number(field.fallback)) / 100, (max - min) * 1e-9);
	const span = Math.log1p((max - min) / floor);
	return { to: v => Math.log1p((v - min) / floor) / span, from: t => min + floor * Math.expm1(t * span), digits: null };
}

function tidy(field, scale, value) {
	if (field.whole)
		return String(Math.round(value));
	return String(Number(scale.digits === null ? value.toPrecision(3) : value.toFixed(scale.digits)));
}

// Short enough for the box; what is sent is never rounded.
const shortened = text => text && Number.isFinite(Number(text)) ? String(Number(Number(text).toPrecision(6))) : text;

const wants_slider = field => field.kind === "number" && field.min !== undefined && !(field.whole && field.max > 1e6);

/* Each maker returns { node, show(text | null, fallback) }; set(text | null) tells the form. */
const makers = {
	number(field, id, set) {
		const input = el("input", { id, type: "text", inputmode: "decimal", class: "value" });
		input.addEventListener("input", () => set(input.value.trim().replace(",", ".") || null));
		if (!wants_slider(field))
			return { node: input, input, show(text, fallback) {
				if (document.activeElement !== input)
					input.value = text ?? "";
				input.placeholder = shortened(fallback);
			} };
		const scale = slider_scale(field);
		const slider = el("input", { type: "range", min: 0, max: SLIDER_STEPS, step: "any", "aria-label": `${field.label}, slider` });
		slider.addEventListener("input", () => set(tidy(field, scale, scale.from(slider.value / SLIDER_STEPS))));
		return { node: el("div", { class: "pair" }, slider, input), input, show(text, fallback) {
			if (document.activeElement !== input)
				input.value = text ?? "";
			input.placeholder = shortened(fallback);
			const value = Number(text ?? fallback);
			if (document.activeElement !== slider || text === null)
				slider.value = SLIDER_STEPS * Math.min(1, Math.max(0, scale.to(Number.isFinite(value) ? value : field.min)));
			slider.classList.toggle("unset", text === null);
		} };
	},

	enum(field, id, set) {
		const unset = el("option", { value: "" });
		const input = el("select", { id }, unset, ...field.names.map(name => el("option", { value: name }, name.replaceAll("_", " "))));
		input.addEventListener("change", () => set(input.value || null));
		return { node: input, input, show(text, fallback) {
			unset.textContent = `${fallback.replaceAll("_", " ")} (default)`;
			input.value = text ?? "";
		} };
	},

	switch(field, id, set) {
		const input = el("input", { id, type: "checkbox", role: "switch", class: "switch" });
		input.addEventListener("change", () => set(String(input.checked)));
		return { node: input, input, show(text, fallback) {
			input.checked = (text ?? fallback) === "true" || text === "1";
		} };
	},

	flags(field, id, set) {
		const boxes = field.names.map((name, i) => el("input", { type: "checkbox", value: name, id: i ? `${id}-${i}` : id }));
		const tell = () => set(boxes.filter(b => b.checked).map(b => b.value).join(",") || null);
		const node = el("div", { class: "flags", role: "group", "aria-label": field.label },
			...boxes.map(box => el("label", {}, box, box.value.replaceAll("_", " "))));
		boxes.forEach(box => box.addEventListener("change", tell));
		return { node, input: boxes[0], show(text) {
			const on = (text ?? "").split(",");
			boxes.forEach(box => { box.checked = on.includes(box.value); });
		} };
	},

	// RFC 3339 in UTC, with a slider through the day.
	time(field, id, set) {
		const input = el("input", { id, type: "datetime-local", step: 1 });
		const slider = el("input", { type: "range", min: 0, max: 1439, step: 1, "aria-label": `${field.label}, minute of the day` });
		let shown = "";
		const utc = text => text ? `${text.length === 16 ? `${text}:00` : text}Z` : null;
		input.addEventListener("change", () => set(utc(input.value)));
		slider.addEventListener("input", () => {
			const day = (shown || field.fallback).slice(0, 10);
			const minutes = Number(slider.value);
			const two = n => String(n).padStart(2, "0");
			set(`${day}T${two(Math.floor(minutes / 60))}:${two(minutes % 60)}:00Z`);
		});
		return { node: el("div", { class: "stack" }, input, slider), input, show(text, fallback) {
			const date = new Date(text ?? fallback);
			shown = Number.isNaN(date.getTime()) ? "" : date.toISOString();
			input.value = shown.slice(0, 19);
			input.classList.toggle("unset", text === null);
			slider.classList.toggle("unset", text === null);
			if (shown && document.activeElement !== slider)
				slider.value = date.getUTCHours() * 60 + date.getUTCMinutes();
		} };
	},

	text(field, id, set) {
		const input = el("input", { id, type: "text", class: "wide", spellcheck: "false" });
		input.addEventListener("input", () => set(input.value.replaceAll(/\s+/g, "") || null));
		return { node: input, input, show(text, fallback) {
			if (document.activeElement !== input)
				input.value = text ?? "";
			input.placeholder = fallback.split(",").map(shortened).join(", ");
		} };
	},
};
makers.triple = makers.text;

class Row {
	constructor(field, set) {
		const id = `f-${field.name}`;
		this.field = field;
		this.control = (makers[field.kind] ?? makers.text)(field, id, set);
		this.help = el("p", { class: "help", id: `${id}-help`, hidden: true }, field.help);
		this.fault = el("p", { class: "fault", id: `${id}-fault`, hidden: true });
		this.clear = el("button", { type: "button", class: "clear", title: "Back to the default", "aria-label": `${field.label}: back to the default`,
			hidden: true, onclick: () => { set(null); this.control.input.focus(); } }, "×");
		const more = el("button", { type: "button", class: "more", "aria-expanded": "false", "aria-controls": `${id}-help`,
			"aria-label": `About ${field.label}`, title: field.help, onclick: () => {
				this.help.hidden = !this.help.hidden;
				more.setAttribute("aria-expanded", String(!this.help.hidden));
			} }, "?");
		this.control.input.setAttribute("aria-describedby", `${id}-help ${id}-fault`);
		this.node = el("div", { class: `field ${field.kind}`, "data-field": field.name },
			el("div", { class: "head" },
				el("label", { for: id }, field.label), field.unit ? el("span", { class: "unit" }, field.unit) : null,
				this.clear, more),
			this.control.node, this.fault, this.help);
	}

	show(text, fallback) {
		this.control.show(text, fallback);
		this.clear.hidden = text === null;
		this.node.classList.toggle("set", text !== null);
	}

	complain(message) {
		this.fault.hidden = !message;
		this.fault.textContent = message ?? "";
		this.node.classList.toggle("faulty", Boolean(message));
		this.control.input.toggleAttribute("aria-invalid", Boolean(message));
	}
}

// open: keys of the groups that stand open at first. changed(name, text | null): a person did it.
export function make_form(form, fields, open, changed) {
	const rows = new Map();
	for (const group of group_fields(fields)) {
		const count = el("span", { class: "count" });
		const details = el("details", { open: open.includes(group.key), id: `g-${group.key}` },
			el("summary", {}, el("span", {}, group.title), count));
		const members = [];
		for (const part of group.parts.values()) {
			if (part.title)
				details.append(el("h3", {}, part.title));
			for (const field of part.fields) {
				const row = new Row(field, text => changed(field.name, text));
				members.push(row);
				rows.set(field.name, row);
				details.append(row.node);
			}
		}
		for (const row of members)
			row.group = { details, count, members };
		form.append(details);
	}

	return {
		// state: Map of name → text; fallbacks: the same, of what unset fields get where that is known.
		show(state, fallbacks) {
			for (const row of rows.values())
				row.show(state.get(row.field.name) ?? null, fallbacks.get(row.field.name) ?? row.field.fallback);
			for (const row of rows.values()) {
				const n = row.group.members.filter(m => state.has(m.field.name)).length;
				row.group.count.textContent = n ? String(n) : "";
			}
		},
		// faults: [{ field, detail, allowed }]. Returns those that belong to no row.
		complain(faults) {
			for (const row of rows.values())
				row.complain(null);
			return faults.filter(fault => {
				const row = rows.get(fault.field);
				if (!row)
					return true;
				row.complain(fault.allowed ? `${fault.detail} – allowed: ${fault.allowed}` : fault.detail);
				row.group.details.open = true;
				return false;
			});
		},
	};
}
