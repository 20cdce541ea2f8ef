// Starting points: what each button sets. A button first unsets what its row may have set, and
// fields that this daemon does not know are left out.

export const rows = [
	{
		title: "Light",
		clears: ["time", "sun.elevation_deg", "sun.azimuth_deg"],
		buttons: [
			{ label: "Now", set: () => ({ "time": `${new Date().toISOString().slice(0, 19)}Z` }) },
			{ label: "Sunrise", set: { "sun.elevation_deg": "0.5", "sun.azimuth_deg": "65" } },
			{ label: "Morning", set: {} },
			{ label: "Noon", set: { "sun.elevation_deg": "75", "sun.azimuth_deg": "180" } },
			{ label: "Golden hour", set: { "sun.elevation_deg": "6", "sun.azimuth_deg": "280" } },
			{ label: "Sunset", set: { "sun.elevation_deg": "0.5", "sun.azimuth_deg": "295" } },
			{ label: "Twilight", set: { "sun.elevation_deg": "-4", "sun.azimuth_deg": "300" } },
		],
	},
	{
		title: "View",
		clears: ["image.projection", "image.width", "image.height", "camera.altitude_m", "camera.position_m", "camera.pitch_deg",
			"camera.roll_deg", "camera.fov_deg", "camera.heading_deg"],
		buttons: [
			{ label: "Ground", set: {} },
			{ label: "Looking up", set: { "camera.pitch_deg": "25", "camera.fov_deg": "85" } },
			{ label: "From 10 km", set: { "camera.altitude_m": "10000", "camera.pitch_deg": "-3" } },
			{ label: "From orbit", set: { "camera.altitude_m": "400000", "camera.pitch_deg": "-18" } },
			{ label: "Planet", set: { "camera.altitude_m": "20000000", "camera.pitch_deg": "-90", "camera.fov_deg": "40" } },
			{ label: "Dome", set: { "image.projection": "fisheye", "camera.pitch_deg": "90" } },
			{ label: "Panorama", set: { "image.projection": "equirectangular" } },
			{ label: "Cube cross", set: { "image.projection": "cubemap" } },
		],
	},
];

export function settings_of(button) {
	return typeof button.set === "function" ? button.set() : button.set;
}

// Whether the state is what the button makes of it, as far as its row goes.
export function is_on(row, button, state) {
	if (typeof button.set === "function")
		return false;
	return row.clears.every(name => (state.get(name) ?? null) === (button.set[name] ?? null));
}
