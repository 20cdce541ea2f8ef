// The page: a form made from /openapi.json, the picture that GET /v1/render.png makes of it, and
// the state of the form in the address after '#', to keep and to share.
import { $, el } from "./dom.js";
import { as_text, read_fields } from "./fields.js";
import { make_form } from "./form.js";
import { is_on, rows, settings_of } from "./quick.js";
import { parse_plan, parse_timing, show_plan, show_problem, show_timings } from "./view.js";

const PREVIEW_WIDTH = 400;
const PREVIEW_DELAY_MS = 40;
const FULL_DELAY_MS = 450;
const FAST_ENOUGH_MS = 120; // full pictures that come faster need no preview
const MAX_RETRIES = 5;

const state = new Map(); // field name → text, of the fields that are set
let fields = [], form, presets = new Map();
let last_full_ms = Infinity;

/* ---- state and addresses ---- */

const encode = text => encodeURIComponent(text).replaceAll("%2C", ",").replaceAll("%3A", ":");

function query_of(settings) {
	return fields.filter(f => settings.has(f.name) && !(f.fixed && settings.get(f.name) === f.fallback))
		.map(f => `${f.name}=${encode(settings.get(f.name))}`).join("&");
}

function address(format, settings) {
	const query = query_of(settings);
	return new URL(`v1/render.${format}${query ? `?${query}` : ""}`, document.baseURI).href;
}

function read_hash() {
	state.clear();
	for (const [name, value] of new URLSearchParams(location.hash.slice(1)))
		if (fields.some(f => f.name === name))
			state.set(name, value);
}

function write_hash() {
	history.replaceState(null, "", `${location.pathname}${location.search}${state.size ? `#${query_of(state)}` : ""}`);
}

/* ---- rendering ---- */

let running = null; // AbortController of the request under way
let timers = [];
let picture_url = null;

// The same picture, smaller: null where the picture is small already.
function preview_of(settings) {
	const size = { width: "image.width", height: "image.height" };
	const [width, height] = [Number(settings.get(size.width)), Number(settings.get(size.height))];
	const small = new Map(settings);
	if (width > 0 && width <= PREVIEW_WIDTH)
		return null;
	if (!settings.has(size.height) || !(height > 0)) {
		small.set(size.width, String(PREVIEW_WIDTH));
	} else if (width > 0) {
		small.set(size.width, String(PREVIEW_WIDTH));
		small.set(size.height, String(Math.max(1, Math.round(height * PREVIEW_WIDTH / width))));
	} else {
		small.set(size.height, String(Math.min(height, PREVIEW_WIDTH)));
	}
	return small;
}

async function show_picture(blob) {
	const url = URL.createObjectURL(blob);
	const fresh = new Image();
	fresh.src = url;
	await fresh.decode();
	const picture = $("picture");
	picture.src = url;
	$("frame").style.setProperty("--aspect", fresh.naturalWidth / fresh.naturalHeight);
	if (picture_url)
		URL.revokeObjectURL(picture_url);
	picture_url = url;
	return `${fresh.naturalWidth} × ${fresh.naturalHeight}`;
}

async function refuse(response, retries) {
	let problem = { title: `${response.status} ${response.statusText}` };
	if (/json/.test(response.headers.get("Content-Type") ?? ""))
		problem = await response.json();
	show_problem(problem, form.complain(problem.errors ?? []));
	const wait_s = Number(response.headers.get("Retry-After"));
	if ((response.status === 503 || response.status === 429) && retries < MAX_RETRIES)
		timers.push(setTimeout(() => render(state, false, retries + 1), 1000 * Math.max(1, wait_s || 1)));
}

async function render(settings, preview, retries = 0) {
	running?.abort();
	const mine = running = new AbortController();
	const started = performance.now();
	$("frame").classList.add("busy");
	try {
		const response = await fetch(address("png", settings), { signal: mine.signal });
		if (!response.ok) {
			await refuse(response, retries);
			return;
		}
		const blob = await response.blob();
		const here_ms = performance.now() - started;
		const size = await show_picture(blob);
		if (mine.signal.aborted)
			return;
		if (!preview)
			last_full_ms = here_ms;
		form.complain([]);
		show_problem(null);
		show_timings(parse_timing(response.headers.get("Server-Timing")), here_ms);
		show_plan(parse_plan(response.headers.get("Welkin-Plan")));
		$("badge").textContent = [size, response.headers.get("Welkin-Method")?.replaceAll("_", " "),
			response.headers.get("Welkin-Device")?.replace(/ \(.*/, ""), preview ? "preview" : ""].filter(Boolean).join(" · ");
		$("frame").dataset.shown = preview ? "preview" : "full";
	} catch (error) {
		if (error.name !== "AbortError")
			show_problem({ title: "The daemon did not answer", detail: String(error.message ?? error) });
	} finally {
		if (running === mine) {
			running = null;
			$("frame").classList.remove("busy");
		}
	}
}

function schedule() {
	timers.forEach(clearTimeout);
	const now = new Map(state);
	const small = last_full_ms > FAST_ENOUGH_MS && last_full_ms !== Infinity ? preview_of(now) : null;
	timers = [];
	if (small)
		timers.push(setTimeout(render, PREVIEW_DELAY_MS, small, true));
	timers.push(setTimeout(render, small ? FULL_DELAY_MS : PREVIEW_DELAY_MS, now, false));
}

/* ---- what a person sees of the state ---- */

// What unset fields get: the numbers of the presets that are chosen.
function fallbacks() {
	const chosen = [...presets].map(([name, list]) => list.get(state.get(name) ?? fields.find(f => f.name === name)?.fallback));
	return new Map(chosen.flatMap(numbers => [...(numbers ?? [])]));
}

function refresh() {
	form.show(state, fallbacks());
	const url = address("png", state);
	$("url").value = url;
	$("curl").value = `curl -o sky.png '${url}'`;
	$("png").href = url;
	$("exr").href = address("exr", state);
	for (const { row, button, node } of chips)
		node.setAttribute("aria-pressed", String(is_on(row, button, state)));
}

function changed() {
	write_hash();
	refresh();
	schedule();
}

const chips = [];

function make_chips() {
	for (const row of rows) {
		const nodes = row.buttons.map(button => {
			const node = el("button", { type: "button", class: "chip", "aria-pressed": "false", onclick: () => {
				row.clears.forEach(name => state.delete(name));
				for (const [name, value] of Object.entries(settings_of(button)))
					if (fields.some(f => f.name === name))
						state.set(name, value);
				changed();
			} }, button.label);
			chips.push({ row, button, node });
			return node;
		});
		$("chips").append(el("div", { class: "chiprow", role: "group", "aria-label": row.title }, el("span", {}, row.title), ...nodes));
	}
}

function make_copy_buttons() {
	for (const button of document.querySelectorAll("[data-copy]")) {
		const input = $(button.dataset.copy);
		input.addEventListener("focus", () => input.select());
		button.addEventListener("click", async () => {
			input.select();
			try {
				await navigator.clipboard.writeText(input.value);
			} catch {
				document.execCommand("copy"); // pages that are not on https or loopback have no clipboard
			}
			button.textContent = "Copied";
			setTimeout(() => { button.textContent = "Copy"; }, 1500);
		});
	}
}

// By the field that chooses them, then by name: the values they set.
function read_presets(reply) {
	const found = new Map();
	for (const p of reply.presets) {
		const list = found.get(p.field) ?? new Map();
		list.set(p.name, new Map(Object.entries(p.fields).map(([name, value]) => [name, as_text(value)])));
		found.set(p.field, list);
	}
	return found;
}

async function start() {
	const json = async path => {
		const response = await fetch(path);
		if (!response.ok)
			throw new Error(`${path}: ${response.status}`);
		return response.json();
	};
	try {
		const [api, known] = await Promise.all([json("openapi.json"), json("v1/presets")]);
		fields = read_fields(api);
		presets = read_presets(known);
	} catch (error) {
		show_problem({ title: "The list of fields can't be read", detail: String(error.message) });
		return;
	}
	form = make_form($("fields"), fields, ["sun", "place", "camera"], (name, text) => {
		if (text === null)
			state.delete(name);
		else
			state.set(name, text);
		changed();
	});
	make_chips();
	make_copy_buttons();
	$("fields").addEventListener("submit", event => event.preventDefault());
	$("reset").addEventListener("click", () => {
		state.clear();
		changed();
	});
	addEventListener("hashchange", () => {
		read_hash();
		refresh();
		schedule();
	});
	read_hash();
	refresh();
	render(new Map(state), false);
}

start();
