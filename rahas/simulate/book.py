"""The simulation book (config/simulation.yaml): set-ups of the rig, and the captures rendered with them."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from rahas.simulate.specs import CameraSpec, CaptureSpec, EncodingSpec, HandSpec, PoseSpec, RigSpec, SceneSpec, Spec


class SetupSpec(Spec):
    """The rig as it stood at a site, and where the calibration target stood before it."""

    rig: RigSpec = RigSpec()
    target: PoseSpec = PoseSpec()


class PageSpec(Spec):
    """A capture of the book: a set-up by name, and what differs from a clean capture."""

    setup: str
    scene: SceneSpec
    hand: HandSpec = HandSpec()
    camera: CameraSpec = CameraSpec()
    encoding: EncodingSpec = EncodingSpec()
    photo_light: Literal["flash", "lamp"] = "flash"
    expected: Literal["accepted", "rejected", "not_processed"] = "accepted"
    expected_rule: str = ""
    seed: int = 0


class SimulationBook(Spec):
    """All of config/simulation.yaml."""

    setups: dict[str, SetupSpec]
    captures: dict[str, PageSpec]

    @model_validator(mode="after")
    def _setups_exist(self) -> SimulationBook:
        for scan_id in self.captures:
            self.capture(scan_id)
        return self

    def capture(self, scan_id: str) -> CaptureSpec:
        """The whole specification of one capture.

        Raises
        ------
        ValueError
            The capture or its set-up is not in the book.
        """
        if scan_id not in self.captures:
            raise ValueError(f"captures: read no {scan_id!r}, expected one of {', '.join(self.captures)}")
        page = self.captures[scan_id]
        if page.setup not in self.setups:
            raise ValueError(f"captures.{scan_id}.setup: read {page.setup!r}, expected one of {', '.join(self.setups)}")
        setup = self.setups[page.setup]
        fields = {name: getattr(page, name) for name in PageSpec.model_fields if name != "setup"}
        return CaptureSpec(rig=setup.rig, target=setup.target, **fields)
