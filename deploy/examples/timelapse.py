#!/usr/bin/env python3
"""A day over Mount Fuji as numbered PNG files, with what each picture cost.

Needs python3-requests. Make a film of it with: ffmpeg -framerate 24 -i day/%04d.png day.mp4
"""
import argparse
import datetime
import email.parser
import io
import json
import pathlib
import sys

import requests


class Chunks(io.RawIOBase):
    """What a reply's body says, as a file: pieces come as the daemon sends them."""

    def __init__(self, reply):
        self.pieces, self.rest = reply.iter_content(None), b""

    def readable(self):
        return True

    def readinto(self, buffer):
        self.rest = self.rest or next(self.pieces, b"")
        n = min(len(buffer), len(self.rest))
        buffer[:n], self.rest = self.rest[:n], self.rest[n:]
        return n


def parts(reply):
    """Yields headers and body of each part of a multipart reply as it comes; each says how long it is."""
    stream = io.BufferedReader(Chunks(reply))
    while not (boundary := stream.readline().rstrip()).endswith(b"--"):
        if not boundary:
            raise EOFError("the reply ends before its last part")
        headers = email.parser.BytesHeaderParser().parsebytes(b"".join(iter(lambda: stream.readline().rstrip(b"\r\n") + b"\n", b"\n")))
        yield headers, stream.read(int(headers["Content-Length"]))
        stream.readline()  # the line end before the next boundary


def stop_on_problem(kind, body):
    if kind == "application/problem+json":
        problem = json.loads(body)
        faults = [f"{e['field']}: {e['detail']}" for e in problem.get("errors", [])]
        sys.exit("; ".join([problem.get("detail") or problem.get("title", "?")] + faults))


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
    day = {"image": {"width": args.width}, "camera": {"heading_deg": 180, "pitch_deg": 20, "fov_deg": 90},
           "fps": 24, "duration_s": args.frames / 24,
           "keyframes": [{"at_s": 0, "time": midnight.isoformat()},
                         {"at_s": args.frames / 24, "time": (midnight + datetime.timedelta(days=1)).isoformat()}]}
    with requests.post(f"{args.welkin}/v1/sequences", json=day, stream=True, timeout=120) as reply:
        if not reply.ok:
            stop_on_problem(reply.headers.get("Content-Type"), reply.content)
            reply.raise_for_status()
        for headers, body in parts(reply):
            stop_on_problem(headers["Content-Type"], body)
            (args.out / f"{int(headers['Welkin-Frame']):04}.png").write_bytes(body)
            print(f"{headers['Welkin-Progress']:>9}  {headers['Server-Timing'].rpartition('dur=')[2]:>9} ms  {len(body)} bytes")


if __name__ == "__main__":
    main()
