from dbbstation.errors import ArgumentError as ArgumentError
from dbbstation.errors import StationError as StationError
from dbbstation.instrument.library import known_instruments as known_instruments
from dbbstation.tasks.calibrate import calibrate as calibrate
from dbbstation.tasks.circles import circle as circle
from dbbstation.tasks.circles import circles as circles
from dbbstation.tasks.compare import compare as compare
from dbbstation.tasks.compensate import compensate as compensate
from dbbstation.tasks.diagnose import diagnose as diagnose
from dbbstation.tasks.drive import identify as identify
from dbbstation.tasks.evaluate import evaluate as evaluate
from dbbstation.tasks.history import history as history
from dbbstation.tasks.known import known_sources as known_sources
from dbbstation.tasks.load import load as load
from dbbstation.tasks.mismatch import mismatch as mismatch
from dbbstation.tasks.models import read_model as read_model
from dbbstation.tasks.models import write_model as write_model
from dbbstation.tasks.predict import predict as predict
from dbbstation.tasks.programs import Program as Program
from dbbstation.tasks.simulate import simulate as simulate

__version__: str
