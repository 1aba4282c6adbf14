"""Types of the public names."""

from hdassist.drive.error.cycle import KinematicError as KinematicError
from hdassist.drive.error.cycle import SelfError as SelfError
from hdassist.drive.error.cycle import kinematic_error as kinematic_error
from hdassist.drive.error.cycle import self_error as self_error
from hdassist.drive.error.stiffness import Stiffness as Stiffness
from hdassist.drive.error.stiffness import stiffness as stiffness
from hdassist.drive.error.waves import Trace as Trace
from hdassist.drive.error.waves import trace as trace
from hdassist.drive.loading import load_preset as load_preset
from hdassist.drive.model.deviations import MeasuredTeeth as MeasuredTeeth
from hdassist.drive.model.deviations import MeasuredWheel as MeasuredWheel
from hdassist.drive.model.deviations import PitchFile as PitchFile
from hdassist.drive.model.deviations import ToothDeviations as ToothDeviations
from hdassist.drive.preset.fields import Drive as Drive
from hdassist.features.design import check as check
from hdassist.features.mounting.positions import MountingCurve as MountingCurve
from hdassist.features.mounting.positions import mounting_curve as mounting_curve
from hdassist.readers.pitch import read_pitch as read_pitch
from hdassist.run.errors import HdassistError as HdassistError
from hdassist.run.files import preset_names as preset_names
from hdassist.run.run import Run as Run

__version__: str
