"""Names for arrays in annotations: `Float64[np.ndarray, "V 3"]` says dtype and shape.

For readers and type checkers they are jaxtyping's, which takes as long to load as NumPy. At run time nothing reads
them, so they are the stand-ins that jaxtyping gives to type checkers; the tests replace this module by jaxtyping.
"""

from typing import Annotated as Bool
from typing import Annotated as Float
from typing import Annotated as Float32
from typing import Annotated as Float64
from typing import Annotated as Int32
from typing import Annotated as Int64
from typing import Annotated as UInt8

__all__ = ["Bool", "Float", "Float32", "Float64", "Int32", "Int64", "UInt8"]
