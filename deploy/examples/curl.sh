#!/bin/sh
# Ways to ask with curl. The first argument is where the daemon is.
set -eu
welkin=${1:-http://127.0.0.1:8080}

# A picture, and where its time went.
curl -sS --fail-with-body -o sky.png -D sky.headers "$welkin/v1/render.png?sun.elevation_deg=5"
grep -i '^server-timing:' sky.headers

# The same fields as JSON give the same bytes.
curl -sS --fail-with-body -o again.png "$welkin/v1/render" -H 'Accept: image/png' \
	--json '{"sun": {"elevation_deg": 5}}'
cmp sky.png again.png

# Not changed: 304, and nothing is rendered.
tag=$(sed -n 's/^[Ee][Tt]ag: *\(.*[^[:space:]]\).*/\1/p' sky.headers)
curl -sS -o /dev/null -w '%{http_code}\n' -H "If-None-Match: $tag" "$welkin/v1/render.png?sun.elevation_deg=5"

# An environment map: linear, in half floats, with the distance to the ground as a layer.
curl -sS --fail-with-body -o environment.exr \
	"$welkin/v1/render.exr?image.projection=equirectangular&image.width=512&image.layers=depth&sun.disk=false"

# Spectral radiance of the zenith and of the horizon opposite the sun.
curl -sS --fail-with-body "$welkin/v1/radiance" --json '{"sun": {"elevation_deg": 30, "azimuth_deg": 0},
	"directions": [{"elevation_deg": 90, "azimuth_deg": 0}, {"elevation_deg": 1, "azimuth_deg": 180}],
	"wavelengths_nm": [450, 550, 650]}'

# What is wrong with a request: every faulty field, with what it allows.
curl -sS "$welkin/v1/render.png?sun.elevation_deg=500&camera.fov_deg=wide"
