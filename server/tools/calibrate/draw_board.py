"""A board on paper or on a screen: SVG and PDF in millimetres, PNG in pixels."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from server.calibration.board import DICTIONARIES, Board, BoardError

Rectangle = tuple[float, float, float, float]
"""x, y, width, height, in squares."""
PNG_SQUARE_PX = 160
MARGIN = 0.5
"""White around the board, in squares."""
POINTS_PER_M = 72.0 / 0.0254


def black(board: Board) -> list[Rectangle]:
    """Everything black: squares, and the dark cells of the markers, joined along rows."""
    squares: list[Rectangle] = []
    dark_first = 1 if board.legacy and board.rows % 2 == 0 else 0
    marker = 0
    for row in range(board.rows):
        for column in range(board.columns):
            if (row + column + dark_first) % 2 == 0:
                squares.append((column, row, 1.0, 1.0))
            else:
                squares += _marker(board, marker, column, row)
                marker += 1
    return squares


def _marker(board: Board, number: int, column: int, row: int) -> Iterator[Rectangle]:
    dictionary = cv2.aruco.getPredefinedDictionary(DICTIONARIES[board.dictionary])
    cells = dictionary.markerSize + 2
    bits = np.asarray(dictionary.generateImageMarker(number, cells)) < 128
    share = board.marker_m / board.square_m
    step, off = share / cells, 0.5 * (1.0 - share)
    for k, line in enumerate(bits):
        edges = np.flatnonzero(np.diff(np.concatenate(([0], line.astype(int), [0]))))
        for start, end in edges.reshape(-1, 2):
            x, y = column + off + step * float(start), row + off + step * k
            yield x, y, step * float(end - start), step


def svg(board: Board) -> str:
    """The board with its margin, at its true size where millimetres are honoured."""
    width, height = board.columns + 2 * MARGIN, board.rows + 2 * MARGIN
    mm = 1e3 * board.square_m
    path = "".join(f"M{x:.5g} {y:.5g}h{w:.5g}v{h:.5g}h-{w:.5g}z" for x, y, w, h in black(board))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width * mm:g}mm" '
        f'height="{height * mm:g}mm" viewBox="{-MARGIN:g} {-MARGIN:g} {width:g} {height:g}" '
        f'shape-rendering="crispEdges"><title>ChArUco {board.columns}x{board.rows}, '
        f"{mm:g} mm, {board.dictionary}</title>"
        f'<path fill="#fff" d="M{-MARGIN:g} {-MARGIN:g}h{width:g}v{height:g}h-{width:g}z"/>'
        f'<path d="{path}"/></svg>\n'
    )


def pdf(board: Board) -> bytes:
    """One page of exactly the board's size with its margin: print at 100 %."""
    unit = board.square_m * POINTS_PER_M
    width, height = board.columns + 2 * MARGIN, board.rows + 2 * MARGIN
    lines = [f"{unit:.6f} 0 0 {unit:.6f} 0 0 cm"]
    lines += [
        f"{x + MARGIN:.5f} {height - MARGIN - y - h:.5f} {w:.5f} {h:.5f} re"
        for x, y, w, h in black(board)
    ]
    content = "\n".join([*lines, "f"]).encode()
    box = f"[0 0 {width * unit:.3f} {height * unit:.3f}]"
    bodies = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R >>".encode(),
        f"<< /Length {len(content)} >>\nstream\n".encode() + content + b"\nendstream",
    ]
    out, places = b"%PDF-1.4\n", []
    for number, body in enumerate(bodies, 1):
        places.append(len(out))
        out += f"{number} 0 obj\n".encode() + body + b"\nendobj\n"
    table = "".join(f"{place:010} 00000 n \n" for place in places)
    trailer = f"xref\n0 5\n0000000000 65535 f \n{table}trailer\n<< /Size 5 /Root 1 0 R >>\n"
    return out + f"{trailer}startxref\n{len(out)}\n%%EOF\n".encode()


def png(board: Board) -> bytes:
    """Pixels, for screens and slides."""
    side = PNG_SQUARE_PX
    margin = round(MARGIN * side)
    shape = (board.rows * side + 2 * margin, board.columns * side + 2 * margin)
    image = np.full(shape, 255, dtype=np.uint8)
    for x, y, w, h in black(board):
        u, v = margin + round(x * side), margin + round(y * side)
        image[v : margin + round((y + h) * side), u : margin + round((x + w) * side)] = 0
    return cv2.imencode(".png", image)[1].tobytes()


def write_board(board: Board, path: Path) -> None:
    """Write the board as its file's suffix says.

    Raises:
        BoardError: another suffix.
    """
    match path.suffix.lower():
        case ".svg":
            path.write_text(svg(board), encoding="utf-8")
        case ".pdf":
            path.write_bytes(pdf(board))
        case ".png":
            path.write_bytes(png(board))
        case other:
            raise BoardError(f"board file: .svg, .pdf or .png, not {other or 'no suffix'!r}")
