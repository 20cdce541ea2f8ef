// What comes back with a picture: where the time went, what ran, what was wrong.
import { $, el } from "./dom.js";

// "queue;dur=0.1, cache;desc=\"hit\";dur=2" → [{ name, ms, note }]
export function parse_timing(header) {
	return (header ?? "").split(",").map(entry => {
		const [name, ...rest] = entry.trim().split(";");
		const parameter = key => rest.find(r => r.trim().startsWith(`${key}=`))?.trim().slice(key.length + 1);
		return { name, ms: Number(parameter("dur")), note: parameter("desc")?.replaceAll("\"", "") ?? "" };
	}).filter(entry => entry.name && Number.isFinite(entry.ms));
}

// "sky;ran=?1, ground;ran=?0;why=\"…\"" → [{ name, ran, why }]
export function parse_plan(header) {
	return [...(header ?? "").matchAll(/([\w.-]+);ran=\?([01])(?:;why="([^"]*)")?/g)]
		.map(([, name, ran, why]) => ({ name, ran: ran === "1", why: why ?? "" }));
}

const as_ms = ms => `${ms >= 100 ? ms.toFixed(0) : ms >= 10 ? ms.toFixed(1) : ms.toFixed(2)} ms`;
const plain = name => name.replaceAll(/[_-]/g, " ");

export function show_timings(entries, here_ms) {
	const parts = entries.filter(e => e.name !== "total");
	const sum = parts.reduce((ms, e) => ms + e.ms, 0) || 1;
	const total = entries.find(e => e.name === "total")?.ms ?? sum;
	$("bar").replaceChildren(...parts.map((e, i) => {
		const segment = el("i", { class: `c${i % 8}`, title: `${plain(e.name)}: ${as_ms(e.ms)}` });
		segment.style.flexGrow = e.ms / sum;
		return segment;
	}));
	const row = (name, ms, mark) => el("tr", { class: mark ? "" : "sum" },
		el("th", { scope: "row" }, mark ? el("i", { class: `dot ${mark}` }) : null, name), el("td", {}, as_ms(ms)));
	$("timings").replaceChildren(
		...parts.map((e, i) => row(plain(e.name) + (e.note ? ` (${e.note})` : ""), e.ms, `c${i % 8}`)),
		row("Total at the daemon", total), row("Here, with the network", here_ms));
}

export function show_plan(entries) {
	$("plan").replaceChildren(...entries.map(e => el("li", { class: e.ran ? "ran" : "skipped" },
		el("b", {}, plain(e.name)), el("span", { class: "sr" }, e.ran ? " ran" : " was left out"),
		e.why ? el("span", { class: "why" }, e.why) : null)));
}

// The parts of a problem document that belong to no row of the form; null takes it away.
export function show_problem(problem, faults = []) {
	const box = $("problem");
	box.hidden = !problem;
	if (!problem)
		return;
	const lines = faults.map(f => el("li", {}, f.field ? el("code", {}, f.field) : null, f.field ? " " : null,
		f.allowed ? `${f.detail} – allowed: ${f.allowed}` : f.detail));
	box.replaceChildren(el("strong", {}, problem.title ?? "Something went wrong"), el("p", {}, problem.detail ?? ""),
		lines.length ? el("ul", {}, ...lines) : "");
}
