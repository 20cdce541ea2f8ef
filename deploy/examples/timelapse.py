#!/usr/bin/env python3
"""A day over Mount Fuji as numbered PNG files, with what each picture cost.

Needs python3-requests. Make a film of it with: ffmpeg -framerate 24 -i day/%04d.png day.mp4
"""
import argparse
import datetime
import pathlib
import re
import sys
import time

import requests


def fetch(session, url, fields, tries=5):
    """GET one picture; waits as long as the daemon says when it is busy (429) or restarting (503)."""
    for _ in range(tries):
        reply = session.get(url, params=fields, timeout=120)
        if reply.status_code not in (429, 503):
            break
        time.sleep(float(reply.headers.get("Retry-After", 1)))
    if reply.headers.get("Content-Type", "").startswith("application/problem+json"):
        problem = reply.json()
        faults = [f"{e['field']}: {e['detail']}" for e in problem.get("errors", [])]
        sys.exit("; ".join([problem.get("title", "?")] + faults))
    reply.raise_for_status()
    return reply


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--welkin", default="http://127.0.0.1:8080")
    parser.add_argument("--out", default="day", type=pathlib.Path)
    parser.add_argument("--date", default="2026-06-21")
    parser.add_argument("--frames", default=288, type=int)
    parser.add_argument("--width", default=640, type=int)
    args = parser.parse_args()

    args.out.mkdir(parents=True, exist_ok=True)
    midnight = datetime.datetime.fromisoformat(args.date).replace(tzinfo=datetime.timezone(datetime.timedelta(hours=9)))
    with requests.Session() as session:  # keeps the connection
        for i in range(args.frames):
            at = midnight + datetime.timedelta(days=i / args.frames)
            reply = fetch(session, f"{args.welkin}/v1/render.png",
                          {"time": at.isoformat(timespec="seconds"), "camera.heading_deg": 180, "camera.pitch_deg": 20,
                           "camera.fov_deg": 90, "image.width": args.width})
            (args.out / f"{i:04}.png").write_bytes(reply.content)
            total = re.search(r"total;dur=([\d.]+)", reply.headers["Server-Timing"]).group(1)
            print(f"{at:%H:%M}  {float(total):8.1f} ms  {len(reply.content)} bytes")


if __name__ == "__main__":
    main()
