"""Types of the public names."""

from hdassist.design import check as check
from hdassist.error.cycle import KinematicError as KinematicError
from hdassist.error.cycle import SelfError as SelfError
from hdassist.error.cycle import kinematic_error as kinematic_error
from hdassist.error.cycle import self_error as self_error
from hdassist.error.stiffness import Stiffness as Stiffness
from hdassist.error.stiffness import stiffness as stiffness
from hdassist.error.waves import Trace as Trace
from hdassist.error.waves import trace as trace
from hdassist.errors import HdassistError as HdassistError
from hdassist.files import preset_names as preset_names
from hdassist.loading import load_preset as load_preset
from hdassist.model.deviations import MeasuredTeeth as MeasuredTeeth
from hdassist.model.deviations import MeasuredWheel as MeasuredWheel
from hdassist.model.deviations import PitchFile as PitchFile
from hdassist.model.deviations import ToothDeviations as ToothDeviations
from hdassist.mounting.positions import MountingCurve as MountingCurve
from hdassist.mounting.positions import mounting_curve as mounting_curve
from hdassist.preset.fields import Drive as Drive
from hdassist.readers.pitch import read_pitch as read_pitch
from hdassist.run.run import Run as Run

__version__: str
