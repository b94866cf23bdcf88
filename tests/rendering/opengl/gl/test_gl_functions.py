"""Calls with constant arguments, which are converted once."""

from ctypes import CFUNCTYPE, c_int, c_ubyte, c_uint, c_void_p

from omnisim.rendering.opengl.gl.functions import constant_call


def test_constant_arguments_arrive_as_those_of_a_typed_function():
    given = []
    kinds = c_uint, c_int, c_ubyte, c_void_p, c_int, c_void_p, c_uint, c_void_p
    function = CFUNCTYPE(c_void_p, *kinds)(lambda *values: given.append(values) or 2**47 + 1)
    values = 2**32 - 1, -3, 1, 2**47, -(2**31), None, 7, 2**63 + 5  # the last two on the stack
    call = constant_call(function, *values)
    assert [call(), call()] == [2**47 + 1] * 2
    assert given == [values, values]
