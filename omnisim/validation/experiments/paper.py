"""The paper's two experiments of section 3.2 with extensions: one report."""

from __future__ import annotations

from pathlib import Path

from omnisim.perception.landmarks.color_model import Costs, save_model
from omnisim.perception.localization.filter import read_parameters
from omnisim.report.machine import machine_of_device
from omnisim.report.report import Report, make_folder
from omnisim.runs.run_data import train_on_run
from omnisim.validation.experiments import landmark_sections, localization_sections
from omnisim.validation.experiments.experiment_runs import (
    SEEDS,
    RealExperiment,
    SimulationExperiment,
)
from omnisim.validation.experiments.recordings import Progress, record_all


def run_experiments(folder: Path, device: int | None, progress: Progress) -> Report:
    """Record, train, localize, and write the report; existing recordings are kept.

    Raises:
        OmnisimError: no OpenGL, or files that cannot be written.
    """
    machine = machine_of_device(device)  # fails early without OpenGL
    make_folder(folder)
    runs = record_all(folder, device, progress)
    trained = train_on_run(runs.learning, Costs(), progress("colors", runs.learning.steps))
    save_model(folder / "model.npz", trained.model, runs.learning.landmarks)
    parameters = read_parameters()
    simulated = SimulationExperiment(runs.simulated, trained, parameters, progress)
    real = RealExperiment(runs.real, trained, parameters, progress)
    sections = (
        landmark_sections.images(runs, trained, simulated, real),
        landmark_sections.colors(trained, simulated, real),
        landmark_sections.detection(simulated, real),
        localization_sections.first_experiment(simulated),
        localization_sections.second_experiment(real),
        localization_sections.side_by_side(simulated, real),
        localization_sections.gains(simulated),
        landmark_sections.degradations(simulated, trained, parameters, progress),
    )
    report = Report(
        "Self-localization",
        "The experiments of Schmits and Visser (2008), section 3.2, with omnisim, and further "
        "experiments. The paper does not publish its noise, gate, bins and thresholds: all "
        "parameters are ours. The paper's numbers are listed beside ours where available.",
        sections,
        {"seeds": SEEDS, "parameters": parameters.to_table(full=True)},
        machine=machine,
    )
    report.write(folder)
    return report
