"""Write the network traces of this folder again: `python -m meshreel_bench.networks`."""

from pathlib import Path

from meshreel.io.write import write_file

from .traces import TRACES, as_csv

for name, trace in TRACES.items():
    write_file(Path(__file__).with_name(f"{name}.network.csv"), as_csv(trace).encode())
