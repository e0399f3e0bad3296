"""Writes what an Xvfb screen shows as a PNG. The server must run with -fbdir.

usage: screen_to_png.py <fbdir>/Xvfb_screen0 <picture.png> [<x> <y> <width> <height>]

With a rectangle, only what lies in it: without a window manager a window stays where its program put it.
"""
import struct
import sys
import zlib

source, target = sys.argv[1:3]
with open(source, "rb") as file:
    data = file.read()

# The XWD file header: 25 numbers of 32 bits, big-endian as Xvfb writes them.
header = struct.unpack_from(">25I", data, 0)
header_size, version, pixmap_format, depth, full_width, full_height = header[:6]
byte_order, bits_per_pixel, bytes_per_line, colors = header[7], header[11], header[12], header[19]
if version != 7 or pixmap_format != 2 or depth != 24 or bits_per_pixel != 32:
    sys.exit(f"{source}: not a 24-bit screen of 32 bits per pixel")
start = header_size + colors * 12

left, top, width, height = 0, 0, full_width, full_height
if len(sys.argv) > 3:
    left, top, width, height = map(int, sys.argv[3:7])
    width, height = min(width, full_width - left), min(height, full_height - top)

rows = bytearray()
for y in range(top, top + height):
    first = start + y * bytes_per_line + left * 4
    line = data[first : first + width * 4]
    order = (2, 1, 0) if byte_order == 0 else (1, 2, 3)
    row = bytearray(width * 3)
    for channel, offset in enumerate(order):
        row[channel::3] = line[offset::4]
    rows += b"\0" + row


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


with open(target, "wb") as file:
    file.write(b"\x89PNG\r\n\x1a\n")
    file.write(chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)))
    file.write(chunk(b"IDAT", zlib.compress(bytes(rows), 9)))
    file.write(chunk(b"IEND", b""))
