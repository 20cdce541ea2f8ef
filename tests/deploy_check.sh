#!/bin/bash
# Checks the files of deploy/ with the programs they are for, and through a running daemon where that
# says more than a syntax check. A program that is not installed is named and left out.
#   tests/deploy_check.sh [WELKIN]
set -euo pipefail
cd "$(dirname "$0")/.."
welkin=$(realpath "${1:-${WELKIN_BIN:-build/welkin}}")
work=$(mktemp -d)
pids=()
finish() {
	for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
	for pid in "${pids[@]}"; do wait "$pid" 2>/dev/null || true; done
	rm -rf "$work"
}
trap finish EXIT

passed=0
ok() { echo "ok: $1"; passed=$((passed + 1)); }
fail() { echo "FAILED: $1"; exit 1; }
have() { command -v "$1" >/dev/null || { echo "left out, $1 is not installed: $2"; return 1; }; }
free_port() { python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }
wait_for() { # URL
	for _ in $(seq 100); do curl -sf -o /dev/null "$1" && return 0; sleep 0.1; done
	fail "$1 does not answer"
}

# ---- a daemon ----
"$welkin" serve --config deploy/welkin.conf --listen 127.0.0.1:0 --admin 127.0.0.1:0 --device software --log-level warn >"$work/out" &
pids+=($!)
for _ in $(seq 600); do grep -q ready "$work/out" && break; sleep 0.1; done
url=$(sed -n 's/.*ready: \(http[^ ]*\)\/ admin.*/\1/p' "$work/out")
admin=$(sed -n 's/.*admin \(http[^ ]*\)\/ .*/\1/p' "$work/out")
[ -n "$url" ] && [ -n "$admin" ] || fail "the daemon does not start"
ok "welkin.conf"
curl -sf -o "$work/direct.png" "$url/v1/render.png?image.width=64&image.height=36"

# ---- systemd ----
if have systemd-analyze welkin.service; then
	sed "s|^ExecStart=[^ ]*|ExecStart=$welkin|" deploy/welkin.service >"$work/welkin.service"
	systemd-analyze verify "$work/welkin.service" 2>&1 | grep . && fail "welkin.service"
	systemd-analyze security --offline=true --threshold=25 "$work/welkin.service" >/dev/null || fail "welkin.service is not hardened"
	ok "welkin.service"
fi
"$welkin" serve --help >"$work/help" # a grep that ends early would end a pipe
for option in $(grep -oh 'WELKIN_[A-Z_]*' deploy/welkin.service deploy/kubernetes/*.yaml | grep -v WELKIN_NAME | sort -u); do
	name=$(echo "${option#WELKIN_}" | tr A-Z_ a-z-)
	grep -q -- "--$name " "$work/help" || fail "there is no option --$name"
done
ok "options named in deploy/"

# ---- balancer and cache, with a picture through them ----
if have haproxy haproxy.cfg; then
	haproxy -c -f deploy/haproxy.cfg >/dev/null || fail "haproxy.cfg"
	front=$(free_port)
	sed -e "s|bind 127.0.0.1:8000|bind 127.0.0.1:$front|" -e "s|bind 127.0.0.1:8404|bind 127.0.0.1:$(free_port)|" \
		-e "s|127.0.0.1:8080|${url#http://}|" -e "s|check port 8081|check port ${admin##*:}|" -e '/server sky2/d' \
		deploy/haproxy.cfg >"$work/haproxy.cfg"
	haproxy -f "$work/haproxy.cfg" -db >/dev/null 2>&1 &
	pids+=($!)
	wait_for "http://127.0.0.1:$front/version"
	curl -sf -o "$work/balanced.png" "http://127.0.0.1:$front/v1/render.png?image.width=64&image.height=36"
	cmp "$work/direct.png" "$work/balanced.png" || fail "another picture through HAProxy"
	ok "haproxy.cfg"
fi
if have varnishd varnish.vcl; then
	front=$(free_port)
	chmod 755 "$work"
	sed -e "s|\"8080\"|\"${url##*:}\"|" deploy/varnish.vcl >"$work/varnish.vcl"
	varnishd -F -n "$work/varnish" -f "$work/varnish.vcl" -a "127.0.0.1:$front" -s malloc,64m -j none -T none >"$work/varnish.log" 2>&1 &
	pids+=($!)
	wait_for "http://127.0.0.1:$front/version"
	curl -sf -o "$work/cached.png" "http://127.0.0.1:$front/v1/render.png?image.width=64&image.height=36"
	curl -sf -D "$work/headers" -o "$work/again.png" "http://127.0.0.1:$front/v1/render.png?image.height=36&image.width=64"
	cmp "$work/direct.png" "$work/cached.png" && cmp "$work/cached.png" "$work/again.png" || fail "another picture through Varnish"
	grep -qi '^server-timing: cache;desc="varnish"' "$work/headers" || fail "Varnish does not cache"
	ok "varnish.vcl"
fi

# ---- metrics ----
curl -sf "$admin/metrics" >"$work/metrics"
for metric in $(grep -oh 'welkin_[a-z_]*' deploy/prometheus/*.yml deploy/grafana/*.json | sort -u); do
	grep -q "^$metric[ {]" "$work/metrics" || fail "there is no metric $metric"
done
ok "metrics named in deploy/"
if have promtool prometheus/; then
	promtool check metrics <"$work/metrics" >/dev/null || fail "/metrics"
	promtool check config deploy/prometheus/prometheus.yml >/dev/null || fail "prometheus.yml"
	promtool test rules deploy/prometheus/welkin.rules.test.yml >/dev/null || fail "welkin.rules.yml"
	ok "prometheus/"
fi
python3 - deploy/grafana/welkin.json <<'PYTHON' || fail "grafana/welkin.json"
import json, sys
board = json.load(open(sys.argv[1]))
ids = [p["id"] for p in board["panels"]]
assert len(ids) == len(set(ids)) and all(p["targets"] for p in board["panels"])
for a in board["panels"]:
    for b in board["panels"]:
        p, q = a["gridPos"], b["gridPos"]
        apart = p["x"] + p["w"] <= q["x"] or q["x"] + q["w"] <= p["x"] or p["y"] + p["h"] <= q["y"] or q["y"] + q["h"] <= p["y"]
        assert a is b or apart, (a["title"], b["title"])
PYTHON
ok "grafana/welkin.json"

# ---- Kubernetes: kubectl checks nothing without a cluster, so what matters here is checked by hand ----
if python3 -c 'import yaml' 2>/dev/null; then
	python3 - deploy/kubernetes/welkin.yaml <<'PYTHON' || fail "kubernetes/welkin.yaml"
import sys, yaml
documents = {d["kind"]: d for d in yaml.safe_load_all(open(sys.argv[1]))}
deployment, service = documents["Deployment"]["spec"], documents["Service"]["spec"]
pod = deployment["template"]
container, = pod["spec"]["containers"]
ports = {p["name"]: p["containerPort"] for p in container["ports"]}
arguments = " ".join(container["args"])
assert f"--listen 0.0.0.0:{ports['http']}" in arguments and f"--admin 0.0.0.0:{ports['admin']}" in arguments
for probe, path in (("startupProbe", "/readyz"), ("readinessProbe", "/readyz"), ("livenessProbe", "/livez")):
    assert container[probe]["httpGet"] == {"path": path, "port": "admin"}
assert service["ports"][0]["targetPort"] in ports
labels = pod["metadata"]["labels"].items()
for selector in (deployment["selector"]["matchLabels"], service["selector"], documents["PodDisruptionBudget"]["spec"]["selector"]["matchLabels"]):
    assert selector.items() <= labels
assert pod["metadata"]["annotations"]["prometheus.io/port"] == str(ports["admin"])
PYTHON
	ok "kubernetes/welkin.yaml"
else
	echo "left out, python3-yaml is not installed: kubernetes/welkin.yaml"
fi

# ---- examples ----
(cd "$work" && sh "$OLDPWD/deploy/examples/curl.sh" "$url" >curl.out) || fail "examples/curl.sh"
grep -q '^304$' "$work/curl.out" && grep -q '"radiance"' "$work/curl.out" && grep -q sun.elevation_deg "$work/curl.out" || fail "examples/curl.sh"
ok "examples/curl.sh"
if python3 -c 'import requests' 2>/dev/null; then
	python3 deploy/examples/timelapse.py --welkin "$url" --out "$work/day" --frames 4 --width 64 >/dev/null || fail "examples/timelapse.py"
	[ "$(ls "$work/day" | wc -l)" = 4 ] || fail "examples/timelapse.py"
	ok "examples/timelapse.py"
else
	echo "left out, python3-requests is not installed: examples/timelapse.py"
fi
echo "$passed passed, 0 failed"
