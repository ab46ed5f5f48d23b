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

DIAGNOSE = Layout(
    "results.h5 of diagnose",
    (
        Entry("stations/cmod_m", ("stations",), "m", "CMOD, as the gauge read it, at which is compared"),
        Entry("stations/time_s", ("stations",), "s", "time of the record there"),
        Entry("stations/stage", ("stations",), "1", "0 before the peak, 1 about it, 2 in the tail", "int8"),
        Entry("points_m", ("points", 2), "m", "where displacements are compared"),
        Entry("points_side", ("points",), "1", "−1, +1: flank of the crack", "int8"),
        Entry("path_m", ("k", 2), "m", "crack path that the simulations are held to"),
        Entry("measured/displacement_m", ("stations", "points", 2), "m", "measured displacement", optional=True),
        Entry("measured/displacement_std_m", ("stations", "points"), "m", "its noise, of one component", optional=True),
        Entry("measured/load_n", ("stations",), "N", "measured load", optional=True),
        Entry("measured/load_std_n", ("stations",), "N", "its noise", optional=True),
        Entry("compared", ("numbers",), "1", "which numbers are judged: displacements by station, point, component, "
              "then loads", "bool"),
        Entry("covariance", ("judged", "judged"), "m², m N, N²", "noise, discrepancy and scatter of what is judged"),
        Entry("noise_variance", ("judged",), "m², N²", "of it, the noise"),
        Entry("explanations", ("e",), "1", "none, then the most probable ones", "str"),
        Entry("simulated/parameters", ("e", 2), "N, m", "f_max and delta_max at their best points"),
        Entry("simulated/displacement_m", ("e", "stations", "points", 2), "m", "as the camera would read it"),
        Entry("simulated/load_n", ("e", "stations"), "N", "as the load cell would read it"),
        Entry("curve/cmod_m", ("rows",), "m", "of whole curves, as the gauge reads it"),
        Entry("curve/load_n", ("e", "rows"), "N", "load as the load cell would read it"),
        Entry("modes/names", ("modes",), "1", "of the amplitudes", "str"),
        Entry("modes/amplitude_m", ("e", "modes", "stations"), "m", "of measured minus simulated", optional=True),
        Entry("modes/noise_std_m", ("modes", "stations"), "m", "by noise alone", optional=True),
        Entry("modes/std_m", ("modes", "stations"), "m", "by noise, discrepancy and scatter", optional=True),
        Entry("grid/f_max_n", ("i",), "N", "grid lines of f_max"),
        Entry("grid/delta_max_m", ("j",), "m", "grid lines of delta_max"),
    ),
)  # fmt: skip

DIC_FRAME = Layout(
    "frames/*.h5 of dic",
    (
        Entry("key", None, "1", "SHA-256 of settings and images up to this frame", "str"),
        Entry("number", None, "1", "of the frame; 0 is the reference and has no file", "int64"),
        Entry("base", None, "1", "frame it was matched with; displacements are from frame 0 all the same", "int64"),
        Entry("sound", None, "1", "largest share of sound points since the reference was renewed"),
        Entry("noise_grey", None, "grey", "standard deviation of reference minus matched grey value"),
        Entry("seconds", None, "s", "of the correlation"),
        Entry("columns_px", ("columns",), "px", "of the grid", "int32"),
        Entry("rows_px", ("rows",), "px", "of the grid; point i is column i mod columns, row i div columns", "int32"),
        Entry("warp", ("n", 6), "px, 1", "u, v, u_x, u_y, v_x, v_y of the part that holds the centre", "float32"),
        Entry("status", ("n",), "1", "0 ok, 1 split, 10 and above failed", "uint8"),
        Entry("znssd", ("n",), "1", "0 best, 2(1 − ZNCC)", "float32"),
        Entry("iterations", ("n",), "1", "of Gauss–Newton", "int16"),
        Entry("std_px", ("n", 2), "px", "standard deviation of u and v", "float32"),
        Entry("level", ("n", 2), "1, grey", "gain and offset of the grey values", "float32"),
        Entry(
            "line", ("n", 2), "rad, px", "normal's angle and distance of the cut; NaN where there is none", "float32"
        ),
        Entry("far", ("n", 6), "px, 1", "warp beyond the cut", "float32"),
        Entry("jump_px", ("n", 2), "px", "u and v beyond the cut minus those before it", "float32"),
        Entry("jump_std_px", ("n", 2), "px", "its standard deviation, across and along the cut", "float32"),
        Entry("crack/path_px", ("k", 2), "px", "column, row from the mouth to the tip", optional=True),
        Entry("crack/arc_px", ("k",), "px", "length along the path", optional=True),
        Entry("crack/normal", ("k", 2), "1", "unit vectors across the path", optional=True),
        Entry("crack/opening_px", ("k",), "px", "jump across the path", optional=True),
        Entry("crack/sliding_px", ("k",), "px", "jump along the path", optional=True),
        Entry("crack/std_px", ("k",), "px", "standard deviation of either", optional=True),
        Entry("crack/closing_px", ("k",), "px", "opening made monotone towards the tip", optional=True),
        Entry("crack/tip_px", (2,), "px", "where the opening vanishes", optional=True),
        Entry("crack/tip_std_px", (), "px", "its standard deviation along the path", optional=True),
        Entry("crack/through", (), "1", "whether the crack leaves the field at both ends", "bool", optional=True),
    ),
)

DIC = Layout(
    "results.h5 of dic",
    (
        Entry("points_px", ("n", 2), "px", "column, row of the grid points"),
        Entry("points_m", ("n", 2), "m", "the same in specimen coordinates"),
        Entry("frames/stamp_s", ("frames",), "s", "time of each image as frames.csv has it"),
        Entry("frames/record_time_s", ("frames",), "s", "the same on the clock of load_cmod.csv", optional=True),
        Entry("frames/valid_fraction", ("frames",), "1", "points with a result, of those that ever had one"),
        Entry("frames/split_fraction", ("frames",), "1", "points cut by a line, of those that ever had a result"),
        Entry("frames/opening_m", ("frames",), "m", "across the notch, seen by the camera", optional=True),
        Entry("frames/opening_std_m", ("frames",), "m", "its standard deviation", optional=True),
        Entry("frames/tip_px", ("frames", 2), "px", "crack tip; NaN where no crack stands out"),
        Entry("frames/tip_std_px", ("frames",), "px", "its standard deviation along the path"),
        Entry("frames/tip_m", ("frames", 2), "m", "crack tip in specimen coordinates"),
        Entry("last/displacement_m", ("n", 2), "m", "in the last frame; NaN where invalid"),
        Entry("last/std_px", ("n", 2), "px", "its standard deviation, column and row", "float32"),
        Entry("last/status", ("n",), "1", "0 ok, 1 split, 10 and above failed", "uint8"),
        Entry("last/znssd", ("n",), "1", "0 best", "float32"),
        Entry("crack/path_m", ("k", 2), "m", "in the last frame that has a crack, mouth to tip", optional=True),
        Entry("crack/arc_m", ("k",), "m", "length along the path", optional=True),
        Entry("crack/opening_m", ("k",), "m", "jump across the path", optional=True),
        Entry("crack/sliding_m", ("k",), "m", "jump along the path", optional=True),
        Entry("crack/std_m", ("k",), "m", "standard deviation of either", optional=True),
        Entry("crack/closing_m", ("k",), "m", "opening made monotone towards the tip", optional=True),
    ),
)

CREEP = Layout(
    "results.h5 of creep",
    (
        Entry("measured/time_s", ("readings",), "s", "as read"),
        Entry("measured/compliance_per_pa", ("readings",), "1/Pa", "as read"),
        Entry("measured/temperature_c", ("readings",), "°C", "as read", optional=True),
        Entry("measured/reduced_time_s", ("readings",), "s", "time at the temperature of the results"),
        Entry("fit/time_s", ("rows",), "s", "where the curves are given"),
        Entry("fit/compliance_per_pa", ("rows",), "1/Pa", "creep compliance of the Burgers model"),
        Entry("fit/compliance_95_per_pa", ("rows", 2), "1/Pa", "its 95 % band"),
        Entry("fit/modulus_pa", ("rows",), "Pa", "relaxation modulus of the Burgers model"),
        Entry("fit/modulus_95_pa", ("rows", 2), "Pa", "its 95 % band"),
        Entry("fit/log_covariance", (4, 4), "1", "of the logarithms of d1, d2, eta1, tau2"),
        Entry("prony/compliance_per_pa", ("rows",), "1/Pa", "creep compliance of the series"),
        Entry("prony/modulus_pa", ("rows",), "Pa", "relaxation modulus of the series"),
        Entry("master/temperature_c", ("temperatures",), "°C", "measured ones", optional=True),
        Entry("master/log10_shift", ("temperatures",), "1", "log₁₀ a_T, 0 at the reference", optional=True),
        Entry("master/covariance", ("temperatures", "temperatures"), "1", "of log₁₀ a_T", optional=True),
    ),
)

LEVELLED = Layout(
    "levelled/*.h5 of identify",
    (
        Entry("points_m", ("points", 2), "m", "where fields are compared"),
        Entry("displacement_m", ("frames", "points", 2), "m", "as correlation sees the simulation; NaN: none found"),
    ),
)

_ROW = ("entries",)
LIBRARY = Layout(
    "library",
    (
        Entry("key", _ROW, "1", "name of the entry, made from what was identified", "str"),
        Entry("mixture", _ROW, "1", "what was tested", "str"),
        Entry("bundle", _ROW, "1", "name of the test", "str"),
        Entry("geometry", _ROW, "1", "seb or dct", "str"),
        Entry("temperature_c", _ROW, "°C", "of the test; NaN where not stated"),
        Entry("thickness_mm", _ROW, "mm", "of the specimen"),
        Entry("bond_area_mm2", _ROW, "mm²", "2 r t of the bundle's lattice"),
        Entry("cmod_rate_mm_per_min", _ROW, "mm/min", "of the test"),
        Entry("f_max_n", _ROW, "N", "strength of a bond of that lattice"),
        Entry("delta_max_m", _ROW, "m", "critical opening"),
        Entry("f_max_95_n", (*_ROW, 2), "N", "95 % interval; NaN where there is none, also below"),
        Entry("delta_max_95_m", (*_ROW, 2), "m", "95 % interval"),
        Entry("variance_f_max", _ROW, "N²", "of the estimate"),
        Entry("covariance", _ROW, "N m", "of f_max and delta_max"),
        Entry("variance_delta_max", _ROW, "m²", "of the estimate"),
        Entry("energy_j_per_m2", _ROW, "J/m²", "f_max delta_max/(2 r t)"),
        Entry("energy_95_j_per_m2", (*_ROW, 2), "J/m²", "95 % interval"),
        Entry("peak_load_n", _ROW, "N", "of the simulation at the optimum"),
        Entry("cmod_at_peak_mm", _ROW, "mm", "likewise"),
        Entry("peak_load_mismatch", _ROW, "1", "simulated over measured peak load, minus one"),
        Entry("engine", _ROW, "1", "what simulated", "str"),
        Entry("objective", _ROW, "1", "what was compared", "str"),
        Entry("version", _ROW, "1", "of the program that identified", "str"),
        Entry("accepted", _ROW, "1", "whether the fit passed its own checks", "bool"),
        Entry("source", _ROW, "1", "folder of the result when it was added", "str"),
        Entry("added", _ROW, "1", "when, UTC", "str"),
        Entry("note", _ROW, "1", "a remark", "str"),
    ),
)

CROSS_CHECK = Layout(
    "results.h5 of cross-check",
    (
        Entry("convergence/accuracy", ("levels",), "1", "asked for, of ever slower runs of LAMMPS"),
        Entry("convergence/steps", ("levels",), "1", "time steps they took"),
        Entry("convergence/curve_error", ("levels",), "1", "difference of the load from equilibrium"),
        Entry("convergence/field_error", ("levels",), "1", "difference of the displacements from equilibrium"),
        Entry("stations/cmod_m", ("stations",), "m", "CMOD at which loads and fields are compared"),
        Entry("runs/load_n", ("runs", "stations"), "N", "load of every run, in the order of result.json"),
    ),
)
