from gpbnb.arithmetic import linalg as linalg
from gpbnb.arithmetic.array import FloatArray as FloatArray
from gpbnb.arithmetic.exits import peek as peek
from gpbnb.arithmetic.fixed import FixedFormat as FixedFormat
from gpbnb.arithmetic.formats import FloatFormat as FloatFormat
from gpbnb.arithmetic.named import (
    BFLOAT16 as BFLOAT16,
)
from gpbnb.arithmetic.named import (
    BINARY16 as BINARY16,
)
from gpbnb.arithmetic.named import (
    BINARY32 as BINARY32,
)
from gpbnb.arithmetic.named import (
    BINARY64 as BINARY64,
)
from gpbnb.arithmetic.named import (
    BINARY128 as BINARY128,
)
from gpbnb.arithmetic.named import (
    DECIMAL32 as DECIMAL32,
)
from gpbnb.arithmetic.named import (
    DECIMAL64 as DECIMAL64,
)
from gpbnb.arithmetic.named import (
    DECIMAL128 as DECIMAL128,
)
from gpbnb.arithmetic.named import (
    FP4_E2M1 as FP4_E2M1,
)
from gpbnb.arithmetic.named import (
    FP6_E2M3 as FP6_E2M3,
)
from gpbnb.arithmetic.named import (
    FP6_E3M2 as FP6_E3M2,
)
from gpbnb.arithmetic.named import (
    FP8_E4M3 as FP8_E4M3,
)
from gpbnb.arithmetic.named import (
    FP8_E5M2 as FP8_E5M2,
)
from gpbnb.arithmetic.named import (
    IBM_704 as IBM_704,
)
from gpbnb.arithmetic.named import (
    IBM_HEX32 as IBM_HEX32,
)
from gpbnb.arithmetic.named import (
    IBM_HEX64 as IBM_HEX64,
)
from gpbnb.arithmetic.named import (
    TF32 as TF32,
)
from gpbnb.arithmetic.rounding import Rounding as Rounding
from gpbnb.arithmetic.second_format import convert as convert
from gpbnb.arithmetic.traced import TracedFunction as TracedFunction
from gpbnb.bounds.guarantee import FilterGuarantee as FilterGuarantee
from gpbnb.bounds.guarantee import Guarantee as Guarantee
from gpbnb.bounds.guarantee import limits as limits
from gpbnb.filters.blocks import BlockFormats as BlockFormats
from gpbnb.filters.forms import Form as Form
from gpbnb.filters.model import LinearModel as LinearModel
from gpbnb.filters.nonlinear import NonlinearModel as NonlinearModel
from gpbnb.filters.nonlinear_system import NonlinearSystem as NonlinearSystem
from gpbnb.filters.smoothing import FixedIntervalSmoother as FixedIntervalSmoother
from gpbnb.filters.smoothing import SmoothedRecord as SmoothedRecord
from gpbnb.filters.system import LinearSystem as LinearSystem
from gpbnb.filters.word_formats import WordFormats as WordFormats
from gpbnb.names import NAMED_FORMATS as NAMED_FORMATS
from gpbnb.wordlength.answer import Requirement as Requirement
from gpbnb.wordlength.bounding import guarantee as guarantee
from gpbnb.wordlength.code import write_code as write_code
from gpbnb.wordlength.emulation import EmulatedRun as EmulatedRun
from gpbnb.wordlength.emulation import emulate as emulate
from gpbnb.wordlength.limit_cycles import LimitCycles as LimitCycles
from gpbnb.wordlength.limit_cycles import limit_cycles as limit_cycles
from gpbnb.wordlength.models import read_model as read_model
from gpbnb.wordlength.records import RecordSurvey as RecordSurvey
from gpbnb.wordlength.records import survey_records as survey_records
from gpbnb.wordlength.required import required_precision as required_precision

__version__: str
