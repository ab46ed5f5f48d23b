"""The HDF5 files of the product, as tables."""

from __future__ import annotations

from pipeline.store.schema import Entry, Layout

FIELDS = Layout(
    "fields.h5",
    (
        Entry("points", ("n", 2), "mm", "reference positions in specimen coordinates"),
        Entry("displacement", ("frames", "n", 2), "mm", "from the unloaded state; reference point → displacement"),
        Entry("time_s", ("frames",), "s", "time of each frame, increasing"),
        Entry("valid", ("frames", "n"), "1", "false where the displacement must not be used", "bool"),
        Entry(
            "std_mm",
            (),
            "mm",
            "standard deviation of one displacement component",
            also=(("n",), ("frames", "n")),
            optional=True,
        ),
    ),
)

SIMULATION = Layout(
    "simulation",
    (
        Entry("key", None, "1", "SHA-256 of problem and engine: the name of the file", "str"),
        Entry("engine", None, "1", "engine and version that solved it", "str"),
        Entry("message", None, "1", "how the run ended", "str"),
        Entry("converged", None, "1", "whether it ended as asked", "bool"),
        Entry("steps", None, "1", "time steps or increments", "int64"),
        Entry("seconds", None, "s", "processor time of the solve"),
        Entry("quasi_static_error", None, "1", "the engine's own estimate, relative"),
        Entry("external_j", None, "J", "machine reaction × machine displacement"),
        Entry("stored_j", None, "J", "elastic energy at the end"),
        Entry("dissipated_j", None, "J", "used up by the bonds"),
        Entry("kinetic_j", None, "J", "kinetic energy at the end"),
        Entry("damping_j", None, "J", "taken out by damping"),
        Entry("curve/time_s", ("rows",), "s", "time of the record"),
        Entry("curve/cmod_m", ("rows",), "m", "crack mouth opening displacement"),
        Entry("curve/load_n", ("rows",), "N", "machine load"),
        Entry("curve/load_line_m", ("rows",), "m", "displacement of the machine", optional=True),
        Entry("curve/load_std_n", ("rows",), "N", "standard deviation of the load", optional=True),
        Entry("cmod_m", ("frames",), "m", "CMOD of the full-field frames"),
        Entry(
            "displacement_m",
            ("frames", "particles", 2),
            "m",
            "of all particles, rounded to 6e-8 relative (single precision)",
            "float32",
        ),
        Entry("reached_m", ("bonds",), "m", "largest opening each bond has seen"),
    ),
)

SIMULATE = Layout(
    "results.h5 of simulate",
    (
        Entry("curve/time_s", ("rows",), "s", "time of the simulated record"),
        Entry("curve/cmod_m", ("rows",), "m", "crack mouth opening displacement"),
        Entry("curve/load_n", ("rows",), "N", "machine load"),
        Entry("curve/load_line_m", ("rows",), "m", "displacement of the machine", optional=True),
        Entry("cmod_m", ("frames",), "m", "CMOD of the full-field frames"),
        Entry("particles/position_m", ("particles", 2), "m", "undeformed, in specimen coordinates"),
        Entry("particles/phase", ("particles",), "1", "0 outside, 1 mastic, 2 aggregate, 3 void", "uint8"),
        Entry("particles/displacement_m", ("frames", "particles", 2), "m", "in every frame", "float32"),
        Entry("bonds/pairs", ("bonds", 2), "1", "the two particles of each bond", "int32"),
        Entry("bonds/phase", ("bonds",), "1", "as of particles, and 4 interface, 5 between two stones", "uint8"),
        Entry("bonds/reached_m", ("bonds",), "m", "largest opening each bond has seen"),
        Entry("observation/points_m", ("points", 2), "m", "where displacements are compared"),
        Entry("observation/displacement_m", ("frames", "points", 2), "m", "there; NaN where invalid"),
    ),
)

IDENTIFY = Layout(
    "results.h5 of identify",
    (
        Entry("grid/f_max_n", ("i",), "N", "grid lines of f_max"),
        Entry("grid/delta_max_m", ("j",), "m", "grid lines of delta_max"),
        Entry("grid/objective", ("i", "j"), "m² or 1", "Φ at the nodes; NaN where not simulated"),
        Entry("grid/load_n", ("i", "j", "stations"), "N", "simulated load"),
        Entry("grid/displacement_m", ("i", "j", "stations", "points", 2), "m", "simulated displacement", optional=True),
        Entry("stations/cmod_m", ("stations",), "m", "CMOD at which is compared"),
        Entry("points_m", ("points", 2), "m", "where is compared", optional=True),
        Entry("measured/load_n", ("stations",), "N", "measured load", optional=True),
        Entry("measured/load_std_n", ("stations",), "N", "its standard deviation", optional=True),
        Entry("measured/displacement_m", ("stations", "points", 2), "m", "measured displacement", optional=True),
        Entry("measured/valid", ("stations", "points"), "1", "whether it may be used", "bool", optional=True),
        Entry("optimum/time_s", ("rows",), "s", "time of the record simulated at the optimum", optional=True),
        Entry("optimum/cmod_m", ("rows",), "m", "crack mouth opening displacement", optional=True),
        Entry("optimum/load_n", ("rows",), "N", "machine load", optional=True),
        Entry("optimum/load_line_m", ("rows",), "m", "displacement of the machine", optional=True),
    ),
)
