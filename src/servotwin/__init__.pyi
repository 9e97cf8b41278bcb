from servotwin import bench as bench
from servotwin import errors as errors
from servotwin import linear as linear
from servotwin import loads as loads
from servotwin import models as models
from servotwin import parameters as parameters
from servotwin import physics as physics
from servotwin import plotting as plotting
from servotwin import signals as signals
from servotwin import simulation as simulation
from servotwin import units as units
from servotwin.models import AveragedServo as AveragedServo
from servotwin.models import AveragedServoInductive as AveragedServoInductive
from servotwin.models import BoundedServo as BoundedServo
from servotwin.models import DCMotor as DCMotor
from servotwin.models import GearedMotor as GearedMotor
from servotwin.parameters import Servo as Servo
from servotwin.parameters import catalog_names as catalog_names
from servotwin.parameters import load_dataset as load_dataset
from servotwin.parameters import load_servo as load_servo
from servotwin.parameters import servo_from_values as servo_from_values
from servotwin.simulation import Result as Result
from servotwin.simulation import Simulator as Simulator
from servotwin.simulation import State as State
from servotwin.simulation import Status as Status
from servotwin.simulation import simulate as simulate

__version__: str
