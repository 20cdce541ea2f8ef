// From the OpenAPI document to what the form needs to know of each field. Nothing here names a
// field: what the daemon learns to take, the page learns to offer.

const units = { deg: "°", "1/m": "m⁻¹", "W/m2/nm": "W/m²/nm" };
const suffix = /_(deg|m|km|ms|s|nm|px|du|ev|per_m)$/;

const spelled = { fov: "field of view", png: "PNG", exr: "EXR", ev: "EV" };

function humanise(text) {
	const words = text.replace(suffix, "").split("_").map(word => spelled[word] ?? word).join(" ");
	return words.charAt(0).toUpperCase() + words.slice(1);
}

// { kind, … } of a JSON schema.
function kind_of(schema) {
	if (schema.oneOf)
		return { kind: "triple", ...kind_of(schema.oneOf.find(s => s.type === "array")), single: true };
	if (schema.enum)
		return { kind: "enum", names: [...new Set(schema.enum.map(String))] };
	if (schema.type === "array" && schema.items.enum)
		return { kind: "flags", names: schema.items.enum.map(String) };
	if (schema.type === "array")
		return { kind: "triple", min: schema.items.minimum, max: schema.items.maximum };
	if (schema.type === "boolean")
		return { kind: "switch" };
	if (schema.type === "string" && schema.format === "date-time")
		return { kind: "time" };
	if (schema.type === "number" || schema.type === "integer")
		return { kind: "number", whole: schema.type === "integer", min: schema.minimum, max: schema.maximum };
	return { kind: "text" };
}

export function as_text(value) {
	return value === undefined || value === null ? "" : Array.isArray(value) ? value.join(",") : String(value);
}

// Every field of GET /v1/render.png, in the document's order.
export function read_fields(api) {
	return Object.values(api.components.parameters)
		.filter(p => "x-order" in p)
		.sort((a, b) => a["x-order"] - b["x-order"])
		.map(p => ({
			name: p.name,
			group: p["x-group"],
			label: humanise(p.name.slice(p.name.lastIndexOf(".") + 1)),
			help: p.description,
			unit: units[p.schema["x-unit"]] ?? p.schema["x-unit"] ?? "",
			...kind_of(p.schema),
			fixed: "default" in p.schema, // else the default depends on other fields
			fallback: as_text("default" in p.schema ? p.schema.default : p.schema["x-default"]),
		}));
}

// Groups that read better together than alone; a group that is not named here stands by itself.
const together = { "": "general", place: "place", tone: "exposure", accuracy: "general" };
const moved = { time: "place" };
const titles = { general: "Accuracy and seed", place: "Time and place", exposure: "Exposure and tone" };

export function group_fields(fields) {
	const groups = new Map();
	for (const field of fields) {
		const key = moved[field.name] ?? together[field.group] ?? field.group;
		const top = key.split(".")[0];
		if (!groups.has(top))
			groups.set(top, { key: top, title: titles[top] ?? humanise(top), parts: new Map() });
		const parts = groups.get(top).parts;
		const part = key.slice(top.length + 1);
		if (!parts.has(part))
			parts.set(part, { title: part && humanise(part), fields: [] });
		parts.get(part).fields.push(field);
	}
	return [...groups.values()];
}
