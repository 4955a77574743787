"""NeCGS as it was published, at several sizes of its network: rates, quality and times, as rows.

python benchmarks/necgs_full.py -o necgs.jsonl --data ../shared/data/performers dancer   # hours, on a GPU
python benchmarks/necgs_full.py -o necgs.jsonl --data ... dancer --frames 10 --size small  # minutes a point, on a core

In: sequences below --data. Out: a row a point (kind `curve`), appended; points that have one are not run again. The
authors vary the rate by the network's size; --channels says which sizes.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from meshreel_bench.codec import coded_row
from meshreel_bench.codecs.necgs import FULL, QUICK, SMALL, NecgsCodec
from meshreel_bench.datasets import open_dataset
from meshreel_bench.rows import Point, append_row, read_rows

from meshreel.metrics.comparison import ComparisonOptions, compare_sequences
from meshreel.types import MeshSequence

EXPERIMENT = "necgs"
SIZES = {"full": FULL, "small": SMALL, "quick": QUICK}


def main() -> int:
    """Measures every point that the file lacks."""
    given = _arguments()
    known = {row["point"] for row in read_rows(given.output)} if given.output.exists() else set()
    for name in given.sequences:
        sequence = open_dataset(name, given.data, given.frames)
        for channels in given.channels:
            options = NecgsCodec(**SIZES[given.size] | {"channels": channels}).options
            point = Point(name, "necgs", options, given.frames, "curve")
            if point.key not in known:
                row = {"point": point.key, "kind": point.kind, "experiment": EXPERIMENT} | measure(
                    name, sequence, options
                )
                append_row(given.output, row)
                print("  ".join(f"{key} {row[key]:.4g}" for key in ("mbps", "d2_psnr_paper", "encode_s", "decode_s")))
    return 0


def measure(name: str, sequence: MeshSequence, options: dict[str, Any]) -> dict[str, Any]:
    """Rate, quality and seconds a frame by the clock: a GPU's time is no processor time."""
    codec, start = NecgsCodec(**options), time.perf_counter()
    data = codec.encode(sequence, _tell)
    encoded = time.perf_counter()
    decoded = list(codec.decode(data))
    seconds = {"encode_s": encoded - start, "decode_s": time.perf_counter() - encoded}
    return {
        "sequence": name,
        "frames": len(sequence),
        **coded_row(codec, sequence, data),
        **{key: value / len(sequence) for key, value in seconds.items()},
        **compare_sequences(sequence, decoded, ComparisonOptions()).to_row(),
    }


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", help="names below --data")
    parser.add_argument("-o", "--output", type=Path, required=True, help="rows, JSON lines")
    parser.add_argument("--data", type=Path, required=True, help="the folder of the sequences")
    parser.add_argument("--frames", type=int, help="the first so many; all without")
    parser.add_argument("--channels", type=int, nargs="+", default=[64], help="of the first module")
    parser.add_argument(
        "--size", choices=SIZES, default="full", help="of the codec: the published one, or smaller ones"
    )
    return parser.parse_args()


def _tell(stage: str, done: int, total: int) -> None:
    if done == total or done % 20 == 0:
        print(f"{stage} {done} of {total}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
