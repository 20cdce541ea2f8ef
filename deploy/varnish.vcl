# Varnish 7 in front of one Welkin. Pictures carry Cache-Control and a strong ETag and depend on nothing but
# their URL, so they cache perfectly; the order of the fields is all there is to tidy up.
vcl 4.1;

import std;

backend welkin {
	.host = "127.0.0.1";
	.port = "8080";
	.connect_timeout = 2s;
	.first_byte_timeout = 120s; # above the daemon's deadline
	.between_bytes_timeout = 30s;
	.probe = {
		.url = "/version";
		.interval = 2s;
		.timeout = 2s;
		.window = 4;
		.threshold = 2;
	}
}

sub vcl_recv {
	unset req.http.Cookie;
	set req.url = std.querysort(req.url);
	if (req.method != "GET" && req.method != "HEAD") {
		return (pass);
	}
	return (hash);
}

sub vcl_backend_response {
	# 429, 503 and 504 say "later" and a problem document says "not like this": nobody else wants either.
	if (beresp.status >= 400) {
		set beresp.uncacheable = true;
		set beresp.ttl = 0s;
		return (deliver);
	}
	# A sky does not go stale by being old: keep it while a fresh one is asked for.
	set beresp.grace = 1h;
	set beresp.keep = 1d; # for If-None-Match to the daemon
	if (bereq.url ~ "^/v1/render\.") {
		set beresp.do_stream = true;
	}
}

sub vcl_deliver {
	# Server-Timing of a hit is that of the render it was; say that it was a hit.
	if (obj.hits > 0) {
		set resp.http.Server-Timing = {"cache;desc="varnish""};
	}
}
