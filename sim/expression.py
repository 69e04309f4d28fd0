"""The small grammar of a heightfield's `height`: arithmetic in x and z, read as text and never executed as code."""

from __future__ import annotations

import ast
import operator

import numpy as np

from sim.limits import LONGEST_EXPRESSION, MOST_EVALUATED

FUNCTIONS = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "abs": np.abs,
    "min": np.minimum, "max": np.maximum,
}  # fmt: skip
TWO = {"min", "max"}  # functions of two arguments; all others take one
CONSTANTS = {"pi": np.pi}
PORTION = 2**14  # points at a time: what waits in brackets for the rest then takes little memory
OPERATORS = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv, ast.Pow: operator.pow,
    ast.UAdd: operator.pos, ast.USub: operator.neg,
}  # fmt: skip


def evaluate(text: str, **variables: np.ndarray) -> np.ndarray:
    """The value of the expression `text` for arrays of one shape given by name.

    Raises ValueError with one line that says what the grammar does not know.
    """
    if len(text) > LONGEST_EXPRESSION:
        raise ValueError(f"an expression may have at most {LONGEST_EXPRESSION} characters")
    values = np.empty(np.broadcast_shapes(*(np.shape(v) for v in variables.values())))
    flat, arrays = values.reshape(-1), {name: np.ravel(v) for name, v in variables.items()}
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        if sum(isinstance(node, (ast.operator, ast.unaryop, ast.Call)) for node in ast.walk(tree)) * flat.size > MOST_EVALUATED:
            raise ValueError(f"takes more than {MOST_EVALUATED:,} operations at {flat.size:,} points")
        with np.errstate(all="ignore"):
            for start in range(0, flat.size, PORTION):
                some = slice(start, start + PORTION)
                flat[some] = _value(tree, CONSTANTS | {name: array[some] for name, array in arrays.items()})
    except SyntaxError as error:
        raise ValueError(f"not an expression: {error.msg}") from None
    except OverflowError:
        raise ValueError("a number too large to compute with") from None
    except (RecursionError, MemoryError):
        raise ValueError("an expression nested too deeply") from None
    return values


def _value(node: ast.AST, names: dict):
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.float64(number)
        case ast.Name(id=name):
            if name not in names:
                raise ValueError(f"unknown name '{name}'; known are {', '.join(sorted(names))}")
            return names[name]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            return OPERATORS[type(op)](_value(left, names), _value(right, names))
        case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATORS:
            return OPERATORS[type(op)](_value(operand, names))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            if name not in FUNCTIONS:
                raise ValueError(f"unknown function '{name}'; known are {', '.join(sorted(FUNCTIONS))}")
            if len(arguments) != (2 if name in TWO else 1):
                raise ValueError(f"{name} takes {'two arguments' if name in TWO else 'one argument'}")
            return FUNCTIONS[name](*(_value(argument, names) for argument in arguments))
    raise ValueError(f"'{ast.unparse(node)[:40]}' is not part of the grammar: numbers, x, z, + - * / **, functions")
