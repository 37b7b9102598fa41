"""State that ordinary programs read in odd ways, and what changes it.

Each line is a program: what comes before the formula, an expression that a formula multiplies by its
argument a, and a change; `;;` ends a line of Python.
"""

from __future__ import annotations

import decimal
import importlib.util
import math
import sys
import warnings
from pathlib import Path
from typing import Any

from compiler.worlds import REJECTED, NotCompilable, outcomes, plain

HEAD = """
import abc, array, collections, contextvars, copy, dataclasses, decimal, enum, fractions, functools, itertools, math, operator
import os, random, sys, threading, time, types, typing, weakref
import numpy as np
import liemech as lm
from liemech import formulas as F

{before}

def f(a, turns):
    return a * ({expression})

def change():
    global K, S, D, T, M, h, g, J, L
    {change}
"""

ROWS = (0.0,), (1.5,), (2.0,)


def module(number: int, folder: Path) -> Any:
    """The program of this number, as a module from a file of its own."""
    before, expression, change = PROGRAMS[number].split(" | ")
    text = HEAD.format(
        before=before.replace(";;", "\n"), expression=expression, change=change.replace(";;", "\n    ") or "pass"
    )
    file = folder / f"odd_{number}.py"
    if not file.exists():
        file.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[file.stem] = made
    spec.loader.exec_module(made)
    return made


def differs(formula: Any) -> str:
    """What native code says and plain Python does not; nothing if it is refused by name."""
    expected = [plain(formula, row, 3) for row in ROWS]
    try:
        found = outcomes(formula, ROWS, 1, 3, 1)
    except NotCompilable:
        return ""
    for right, (values, fine) in zip(expected, found, strict=True):
        if (fine and right is REJECTED) or (right is not REJECTED and values != right):
            return f"{values} instead of {right}"
    return ""


def mistakes(numbers: list[int], folder: Path, changed: bool) -> list[str]:
    """The programs whose native code differs from plain Python: as they are and after the change, or
    (in a new process) `changed` before they are looked at for the first time.
    """
    wrong = []
    sine, context = math.sin, decimal.getcontext().copy()
    for number in numbers:
        try:
            program = module(number, folder)
            found = [] if changed else [differs(program.f)]
            program.change()
            found.append(differs(program.f))
        finally:
            math.sin = sine
            decimal.setcontext(context.copy())
        wrong += [f"{PROGRAMS[number]}: {what}" for what in found if what]
    return wrong


PROGRAMS = r"""
K=2.0 | K | K=5.0
K=[1.0,2.0] | K[1] | K[1]=7.0
K=[1.0,2.0] | K[int(a)%2] | K[0]=7.0;;K[1]=9.
K=[1.0,2.0] | sum(K) | K.append(4.0)
K=[1.0,2.0] | len(K) | K.append(4.0)
K=(1.0,[2.0]) | K[1][0] | K[1][0]=3.0
K={'x':1.0} | K['x'] | K['x']=3.0
K={'x':1.0} | K.get('x',0.0) | K['x']=3.0
K={'x':1.0} | K.get('y',4.0) | K['y']=3.0
K={'x':1.0} | (1.0 if 'y' in K else 2.0) | K['y']=3.0
K={'x':1.0} | sum(K.values()) | K['y']=3.0
K={'x':1.0} | sum(v for k,v in K.items()) | K['y']=3.0
K={1.0:1.0} | sum(k for k in K) | K[4.0]=3.0
K={1.0,2.0} | sum(K) | K.add(4.0)
K=np.array([1.0,2.0]) | K[0] | K[0]=5.0
K=np.array([1.0,2.0]) | K[int(a)%2] | K[:]=5.0
K=np.array([1.0,2.0]) | K.sum() | K[0]=5.0
K=np.array([1.0,2.0]) | float(np.dot(K,K)) | K[0]=5.0
K=np.array([[1.0,2.0],[3.,4.]]) | K[int(a)%2][1] | K[:]=5.0
K=np.array([1.0,2.0]) | (lm.vec(a,a)@K) | K[0]=5.0
B=np.array([1.0,2.0]);;K=B[:1] | K[0] | B[0]=5.0
B=np.array([1.0,2.0]);;K=(B,) | K[0][0] | B[0]=5.0
K=np.ma.array([1.0,2.0],mask=[0,0]) | K.sum() | K.mask=[1,0]
K=np.ma.array([1.0,2.0],mask=[0,1]) | K[int(a)%2] | K[0]=5.
K=np.matrix([[1.0,2.0]]) | K[0,1] | K[0,1]=5.
K=np.float64(2.0) | K | K=np.float64(3.0)
K=types.SimpleNamespace(x=1.0) | K.x | K.x=2.0
K=types.SimpleNamespace(x=1.0) | getattr(K,'x',9.0) | K.x=2.0
K=types.SimpleNamespace(x=1.0) | getattr(K,'y',9.0) | K.y=2.0
K=types.SimpleNamespace(x=1.0) | (1.0 if hasattr(K,'y') else 3.0) | K.y=2.0
K=types.SimpleNamespace(x=[1.0]) | K.x[0] | K.x[0]=2.0
K=types.SimpleNamespace(x=types.SimpleNamespace(y=1.0)) | K.x.y | K.x.y=2.0
K=types.SimpleNamespace(x=1.0) | (1.0 if K==types.SimpleNamespace(x=1.0) else 2.0) | K.x=2.0
K=types.SimpleNamespace(x=1.0) | vars(K)['x'] | K.x=2.0
K=types.SimpleNamespace(x=1.0) | K.__dict__['x'] | K.x=2.0
K=contextvars.ContextVar('k',default=2.0) | K.get() | K.set(3.0)
K=contextvars.ContextVar('k') | K.get(2.0) | K.set(3.0)
K=types.MappingProxyType({'x':1.0}) | K['x'] | K=types.MappingProxyType({'x':2.0})
D={'x':1.0};;K=types.MappingProxyType(D) | K['x'] | D['x']=2.0
D={'x':1.0};;K=types.MappingProxyType(D) | K.get('x',0.0) | D['x']=2.0
D={'x':1.0};;K=types.MappingProxyType(D) | (1.0 if 'y' in K else 2.0) | D['y']=2.0
D={'x':1.0};;K=types.MappingProxyType(D) | sum(K.values()) | D['x']=2.0
D={'x':1.0};;K=types.MappingProxyType(D) | len(K) | D['y']=2.0
D={'x':1.0};;K=D.values() | sum(K) | D['x']=2.0
D={'x':1.0};;K=D.items() | sum(v for k,v in K) | D['x']=2.0
D={1.0:1.0};;K=D.keys() | sum(K) | D[5.0]=2.0
D={'x':1.0};;K=D.get | K('x') | D['x']=2.0
D=[1.0,2.0];;K=D.__getitem__ | K(0) | D[0]=4.0
D=[1.0,2.0];;K=D.index | K(2.0) | D.insert(0,4.0)
D=[1.0,2.0];;K=reversed(D) | sum(K) | D[0]=4.0
D=[1.0,2.0];;K=iter(D) | (next(K,9.0)) | D[0]=4.0
K=itertools.count(1) | next(K) | next(K)
K=itertools.cycle([1.0,2.0]) | next(K) | next(K)
K=(x for x in [1.0,2.0,3.0]) | next(K,9.0) | next(K,9.)
K=zip([1.0],[2.0]) | sum(x for x,y in K) | K=zip([3.0],[2.0])
K=collections.ChainMap({'x':1.0}) | K['x'] | K.maps[0]['x']=2.0
K=collections.ChainMap({'x':1.0}) | K.get('x') | K.maps[0]['x']=2.0
K=collections.ChainMap({'x':1.0}) | K.maps[0]['x'] | K.maps[0]['x']=2.0
K=collections.defaultdict(float) | K['x'] | K['x']=2.0
K=collections.defaultdict(float,{'x':1.0}) | K['x'] | K['x']=2.0
K=collections.defaultdict(float) | K.get('x',3.0) | K['x']=2.0
K=collections.Counter([1,1,2]) | K[1] | K[1]=7
K=collections.Counter([1,1,2]) | K[9] | K[9]=7
K=collections.OrderedDict(x=1.0,y=2.0) | list(K.values())[0] | K.move_to_end('x')
K=collections.deque([1.0,2.0]) | K[0] | K[0]=3.0
K=collections.deque([1.0,2.0]) | sum(K) | K.append(3.0)
K=collections.deque([1.0,2.0]) | K[int(a)%2] | K[0]=3.0;;K[1]=4.
K=collections.UserDict(x=1.0) | K['x'] | K['x']=2.0
K=collections.UserList([1.0]) | K[0] | K[0]=2.0
K=collections.UserList([1.0,2.0]) | K[int(a)%2] | K[0]=2.0;;K[1]=5.
K=collections.namedtuple('N','x y')(1.0,2.0) | K.x | K=K._replace(x=3.0)
K=collections.namedtuple('N','x y')(1.0,[2.0]) | K.y[0] | K.y[0]=3.0
K=collections.namedtuple('N','x y')(1.0,2.0) | K[int(a)%2] | K=K._replace(x=3.0,y=6.)
os.environ['QQ']='1' | float(os.environ['QQ']) | os.environ['QQ']='2'
os.environ['QQ']='1' | float(os.environ.get('QQ')) | os.environ['QQ']='2'
os.environ['QQ']='1' | float(os.getenv('QQ')) | os.environ['QQ']='2'
os.environ.pop('QZ',0) | (1.0 if 'QZ' in os.environ else 2.0) | os.environ['QZ']='2'
g=lambda x,k: x*k;;K=functools.partial(g,k=2.0) | K(a) | K=functools.partial(g,k=3.0)
g=lambda x,k: x*k;;K=functools.partial(g,k=2.0) | K(a) | K.keywords['k']=3.0
S=[2.0];;g=lambda x: x*S[0];;K=functools.partial(g) | K(a) | S[0]=3.0
S=[2.0];;K=functools.lru_cache(lambda: S[0]) | K() | S[0]=3.0;;K.cache_clear()
S=[2.0];;K=functools.cache(lambda: S[0]) | K() | S[0]=3.0;;K.cache_clear()
K=random.Random(1) | K.random() | K.seed(5)
random.seed(1) | random.random() | random.seed(5)
K=np.random.default_rng(1) | K.random() | K.random()
np.random.seed(1) | np.random.rand() | np.random.seed(9)
K=time.time() | K | K=7.0
 | (time.time()>0)*1.0*time.perf_counter() | pass
K=array.array('d',[1.0,2.0]) | K[0] | K[0]=3.0
K=array.array('d',[1.0,2.0]) | K[int(a)%2] | K[0]=3.0;;K[1]=5.
K=array.array('d',[1.0,2.0]) | sum(K) | K[0]=3.0
K=bytearray(b'ab') | K[0] | K[0]=3
K=b'ab' | K[int(a)%2] | K=b'cd'
K=memoryview(np.array([1.0,2.0])) | K[0] | K[0]=3.0
K=decimal.Decimal(1) | float(K/3) | decimal.getcontext().prec=5
K=fractions.Fraction(1,3) | float(K) | K=fractions.Fraction(1,7)
K=threading.local();;K.x=1.0 | K.x | K.x=2.0
K=threading.local();;K.x=1.0 | getattr(K,'y',5.0) | K.y=2.0
K=slice(0,2) | sum((1.0,2.0,3.0)[K]) | K=slice(0,3)
K=range(3) | sum(K) | K=range(4)
K=sys.float_info | K.max*1e-308 | pass
K=operator.itemgetter(0);;S=[1.0] | K(S) | S[0]=2.0
K=operator.attrgetter('x');;S=types.SimpleNamespace(x=1.0) | K(S) | S.x=2.0
K=[1.0];;L=K | L[0] | K[0]=2.0
K=[[1.0],[2.0]] | K[int(a)%2][0] | K[0][0]=5.0;;K[1][0]=6.
K={'x':{'y':[1.0]}} | K['x']['y'][0] | K['x']['y'][0]=5.0
K=[] | (1.0 if K else 2.0) | K.append(1)
K=None | (1.0 if K is None else 2.0) | K=3.0
K='abc' | (1.0 if K=='abc' else 2.0) | K='x'
K='abc' | len(K) | K='x'
K=True | (1.0 if K else 2.0) | K=False
K=math.pi | K | K=3.0
OLD=math.sin | math.sin(a) | math.sin=math.cos
K=1+2j | K.real | K=3+2j
K=frozenset([1.0]) | sum(K) | K=frozenset([2.0])
K=lambda: 2.0 | K() | K=lambda: 3.0
K=lambda x,s=[2.0]: x*s[0] | K(a) | K.__defaults__[0][0]=3.0
K=lambda x: x*2.0 | K(a) | K.__code__=(lambda x: x*3.0).__code__
K=lambda x: x*K.n;;K.n=2.0 | K(a) | K.n=3.0
S=[2.0];;K=S.copy | K()[0] | S[0]=3.0
K=weakref.WeakValueDictionary() | len(K) | pass
K=np.array([1.0,2.0],dtype=object) | K[0] | K[0]=4.0
K=np.array([(1.0,2.0)],dtype=[('x','f8'),('y','f8')]) | K['x'][0] | K['x'][0]=4.0
K=np.recarray((1,),dtype=[('x','f8')]);;K.x[:]=1.0 | K.x[0] | K.x[0]=4.0
K=np.array([1.0,2.0]) | K.T[0] | K[0]=4.0
K=np.array([1.0,2.0]) | K.shape[0] | K=np.array([1.0,2.0,3.0])
K=np.array([1.0,2.0]) | K.flat[0] | K[0]=4.0
K=np.array([1.0,2.0]) | max(K) | K[0]=4.0
K=np.array([1.0,2.0]) | K.real[0] | K[0]=4.0
K=np.nditer(np.array([1.0])) | float(K[0]) | pass
K=copy.copy([1.0]) | K[0] | K[0]=5.0
class L(list):;;  def __getitem__(self,*x): return S[0];;S=[2.0];;K=L([1.0,2.0]) | K[int(a)%2] | S[0]=3.0
class L(list):;;  def __iter__(self,*x): return iter([S[0]]);;S=[2.0];;K=L([1.0,2.0]) | sum(K) | S[0]=3.0
class L(list):;;  def __len__(self,*x): return int(S[0]);;S=[2.0];;K=L([1.0,2.0]) | len(K) | S[0]=3.0
class L(list):;;  def __contains__(self,*x): return S[0] > 2.5;;S=[2.0];;K=L([1.0,2.0]) | (1.0 if 1.0 in K else 2.0) | S[0]=3.0
class L(list):;;  def __add__(self,*x): return S[0];;S=[2.0];;K=L([1.0,2.0]) | (K+[1.0])*1.0 | S[0]=3.0
class L(list):;;  def __mul__(self,*x): return S[0];;S=[2.0];;K=L([1.0,2.0]) | K*2.0 | S[0]=3.0
class L(list):;;  def __bool__(self,*x): return S[0] > 2.5;;S=[2.0];;K=L([1.0,2.0]) | (1.0 if K else 2.0) | S[0]=3.0
class L(list):;;  def __eq__(self,*x): return S[0] > 2.5;;S=[2.0];;K=L([1.0,2.0]) | (1.0 if K==[1.0] else 3.0) | S[0]=3.0
class L(list):;;  def __reversed__(self,*x): return iter([S[0]]);;S=[2.0];;K=L([1.0,2.0]) | sum(reversed(K)) | S[0]=3.0
class L(dict):;;  def __missing__(self,*x): return S[0];;S=[2.0];;K=L({}) | K['q'] | S[0]=3.0
class L(list):;;  def __getattribute__(self,*x): return S[0];;S=[2.0];;K=L([1.0,2.0]) | K.foo | S[0]=3.0
class L(list):;;  def __getattr__(self,*x): return S[0];;S=[2.0];;K=L([1.0,2.0]) | K.foo | S[0]=3.0
class L(list):;;  def index(self,*x): return S[0];;S=[2.0];;K=L([1.0,2.0]) | K.index(1.0) | S[0]=3.0
class L(list):;;  def count(self,*x): return S[0];;S=[2.0];;K=L([1.0,2.0]) | K.count(1.0) | S[0]=3.0
class L(tuple):;;  def __getitem__(self,i): return S[0];;S=[2.0];;K=L((1.0,2.0)) | K[int(a)%2] | S[0]=3.0
class L(tuple):;;  pass;;K=L((1.0,2.0)) | K[int(a)%2] | L.__getitem__=lambda s,i: 9.0
class L(np.ndarray):;;  def __getitem__(self,i): return S[0];;S=[2.0];;K=np.array([1.0,2.0]).view(L) | K[int(a)%2] | S[0]=3.0
class L(np.ndarray):;;  pass;;K=np.array([1.0,2.0]).view(L) | K[int(a)%2] | L.__getitem__=lambda s,i: 9.0
class L(list): pass;;K=L([1.0,2.0]) | K[int(a)%2] | L.__getitem__=lambda s,i: 9.0
class L(list): pass;;K=L([1.0,2.0]) | K[0] | L.__getitem__=lambda s,i: 9.0
class L(list): pass;;K=L([1.0,2.0]) | len(K) | L.__len__=lambda s: 9
class L(list): pass;;K=L([1.0,2.0]) | sum(K) | L.__iter__=lambda s: iter([9.0])
class L(dict): pass;;K=L(x=1.0) | K["x"] | L.__getitem__=lambda s,i: 9.0
class L(dict): pass;;K=L(x=1.0) | K.get("x") | L.get=lambda s,i: 9.0
class L(float): pass;;K=L(2.0) | K | L.__mul__=lambda s,i: 9.0;;L.__rmul__=lambda s,i: 9.0
class L(float):;;  def __rmul__(s,o): return S[0];;  __mul__=__rmul__;;S=[2.0];;K=L(2.0) | K | S[0]=4.0
class L(float):;;  def __float__(s): return S[0];;S=[2.0];;K=L(2.0) | float(K) | S[0]=4.0
class L(int):;;  def __index__(s): return int(S[0]);;S=[2.0];;K=L(0) | (1.0,2.0,3.0)[K] | S[0]=1.0
class L(str):;;  def __eq__(s,o): return S[0]>2.5;;  __hash__=str.__hash__;;S=[2.0];;K=L("a") | (K=="a")*1.0 | S[0]=4.0
class L(str):;;  def __str__(s): return str(S[0]);;S=[2.0];;K=L("a") | float(str(K)) | S[0]=4.0
class L(str):;;  def __format__(s,f): return str(S[0]);;S=[2.0];;K=L("a") | float(f"{K}") | S[0]=4.0
class L(float):;;  def __repr__(s): return str(S[0]);;S=[2.0];;K=L(1.0) | float(f"{K!r}") | S[0]=4.0
class L(float):;;  def __str__(s): return str(S[0]);;S=[2.0];;K=L(1.0) | float("{}".format(K)) | S[0]=4.0
class L(float):;;  def __str__(s): return str(S[0]);;S=[2.0];;K=L(1.0) | float("%s" % K) | S[0]=4.0
class O:;;  x=1.0;;K=O() | K.x | O.x=2.0
class O:;;  x=1.0;;K=O() | K.x | K.x=2.0
class O: pass;;K=O();;K.x=1.0 | K.x | K.x=2.0
class O: pass;;K=O() | getattr(K,"x",3.0) | K.x=2.0
class O: pass;;K=O() | getattr(K,"x",3.0) | O.x=2.0
class O: pass;;K=O() | (1.0 if hasattr(K,"x") else 2.0) | O.x=2.0
class O: pass;;K=O() | (1.0 if callable(K) else 2.0) | O.__call__=lambda s: 1
class O: pass;;K=O() | (1.0 if K else 2.0) | O.__bool__=lambda s: False
class O: pass;;K=O() | (1.0 if K else 2.0) | O.__len__=lambda s: 0
class O:;;  def __bool__(s): return S[0]>2.5;;S=[2.0];;K=O() | (1.0 if K else 2.0) | S[0]=3.0
class O:;;  @property;;  def x(s): return S[0];;S=[2.0];;K=O() | K.x | S[0]=3.0
class O:;;  @functools.cached_property;;  def x(s): return S[0];;S=[2.0];;K=O() | K.x | K.__dict__["x"]=3.0
class O:;;  @staticmethod;;  def x(): return S[0];;S=[2.0];;K=O() | K.x() | S[0]=3.0
class O:;;  @classmethod;;  def x(c): return c.y;;  y=2.0;;K=O() | K.x() | O.y=3.0
class De:;;  def __get__(s,o,c): return S[0];;S=[2.0];;class O:;;  x=De();;K=O() | K.x | S[0]=3.0
class De:;;  def __get__(s,o,c): return S[0];;  def __set__(s,o,v): pass;;S=[2.0];;class O:;;  x=De();;K=O() | K.x | S[0]=3.0
class De:;;  def __get__(s,o,c): return S[0];;S=[2.0];;class O:;;  x=De();;K=O | K.x | S[0]=3.0
class O:;;  def __getattr__(s,n): return S[0];;S=[2.0];;K=O() | K.x | S[0]=3.0
class O:;;  def __getattribute__(s,n): return S[0];;S=[2.0];;K=O() | K.x | S[0]=3.0
class O:;;  __slots__=("x",);;K=O();;K.x=1.0 | K.x | K.x=2.0
class O:;;  __slots__=("x",);;K=O() | getattr(K,"x",5.0) | K.x=2.0
class M(type):;;  @property;;  def x(c): return S[0];;S=[2.0];;class O(metaclass=M): pass;;K=O | K.x | S[0]=3.0
class M(type):;;  def __getattr__(c,n): return S[0];;S=[2.0];;class O(metaclass=M): pass;;K=O | K.x | S[0]=3.0
class M(type):;; def __instancecheck__(c,o): return S[0]>2;;S=[1];;class O(metaclass=M): pass;;K=1 | isinstance(K,O)*1.0 | S[0]=3.0
class O(abc.ABC): pass;;class Q: pass;;K=Q() | (1.0 if isinstance(K,O) else 2.0) | O.register(Q)
class O(abc.ABC): pass;;class Q: pass;;K=Q | (1.0 if issubclass(K,O) else 2.0) | O.register(Q)
class Q: pass;;class R: pass;;K=Q() | (1.0 if isinstance(K,R) else 2.0) | K.__class__=R
class Q:;;  x=1.0;;class R:;;  x=2.0;;K=Q() | K.x | K.__class__=R
class E(enum.Enum):;;  X=1.0;;K=E.X | K.value | E.X._value_=3.0
class E(enum.IntEnum):;;  X=1;;  Y=4;;K=E.X | K*1.0 | K=E.Y
class E(enum.Enum):;;  X=1.0;;  Y=2.0;;K=E.X | (1.0 if K is E.X else 3.0) | K=E.Y
class E(enum.Enum):;;  X=1.0;;  @property;;  def z(s): return S[0];;S=[2.0];;K=E.X | K.z | S[0]=5.0
@dataclasses.dataclass;;class O:;; y: list=dataclasses.field(default_factory=lambda: [1.0]);;K=O() | K.y[0] | K.y[0]=2.0
@dataclasses.dataclass;;class O:;;  x: float=1.0;;K=O() | K.x | K.x=2.0
@dataclasses.dataclass(frozen=True);;class O:;;  x: float=1.0;;K=O() | K.x | object.__setattr__(K,"x",2.0)
@dataclasses.dataclass;;class O:;;  x: float=1.0;;K=O();;J=O() | (1.0 if K==J else 2.0) | K.x=2.0
@dataclasses.dataclass(order=True);;class O:;;  x: float=1.0;;K=O();;J=O(2.0) | (1.0 if K<J else 2.0) | K.x=5.0
@lm.record;;class O(F.Record):;;  x: float=1.0;;K=O() | K.x | K=O(2.0)
@lm.record;;class O(F.Record):;; x: float=1.0;; def __lt__(s,o): return S[0]>2.5;;S=[2.0];;K=O() | (1.0 if K<K else 2.0) | S[0]=3.0
@lm.record;;class O(F.Record):;;  x: float=1.0;;  def m(s): return s.x*S[0];;S=[2.0];;K=O() | K.m() | S[0]=3.0
@lm.record;;class O(F.Record):;;  x: float=1.0;;  def m(s): return s.x;;K=O() | K.m() | O.m=lambda s: 7.0
@lm.record;;class O(F.Record):;;  x: float=1.0;;K=O() | (1.0 if hasattr(K,"zz") else 2.0) | O.zz=1
@lm.record;;class O(F.Record):;;  x: float=1.0;;K=O() | (1.0 if K else 2.0) | O.__bool__=lambda s: False
@lm.record;;class O(F.Record):;;  x: float=1.0;;K=O() | (1.0 if callable(K) else 2.0) | O.__call__=lambda s: 1
@lm.record;;class O(F.Record):;;  x: float=1.0;;  def __repr__(s): return str(S[0]);;S=[2.0];;K=O() | float(repr(K)) | S[0]=4.0
def mk():;;  n=[1.0];;  def g(x): return x*n[0];;  return g,n;;g,n=mk() | g(2.0) | n[0]=3.0
def mk():;;  n=1.0;;  def g(x): return x*n;;  def s(v):;;    nonlocal n;;    n=v;;  return g,s;;g,s=mk() | g(2.0) | s(3.0)
def h(): return 2.0;;def g(): return h() | g() | def h(): return 3.0
S=[2.0];;def o(f):;; @functools.wraps(f);; def w(*x): return f(*x)*S[0];; return w;;@o;;def g(x): return x | g(1.0) | S[0]=3.0
class O:;;  def m(s,x): return x*2.0;;K=O().m | K(1.0) | O.m=lambda s,x: x*5.0;;K=O().m
class O:;;  def m(s,x): return x*s.k;;K=O();;K.k=2.0 | K.m(1.0) | K.m=lambda x: 9.0
class B:;;  def m(s): return 1.0;;class O(B): pass;;K=O() | K.m() | O.m=lambda s: 9.0
class B:;;  x=1.0;;class B2:;;  x=2.0;;class O(B): pass;;K=O() | K.x | O.__bases__=(B2,)
class O:;;  def __call__(s,x): return x*S[0];;S=[2.0];;K=O() | K(1.0) | S[0]=3.0
M=types.ModuleType("mm");;M.x=1.0 | M.x | M.x=2.0
M=types.ModuleType("mm");;M.__getattr__=lambda n: S[0];;S=[2.0] | M.x | S[0]=3.0
M=types.ModuleType("mm") | getattr(M,"x",4.0) | M.x=3.0
class Q:;;  x=1.0;;T=Q();;K=weakref.ref(T) | K().x | T.x=2.0
class Q:;;  x=1.0;;T=Q();;K=weakref.proxy(T) | K.x | T.x=2.0
class Q:;;  x=1.0;;T=Q();;K=weakref.proxy(T) | getattr(K,"y",3.0) | T.y=2.0
import ctypes;;K=ctypes.c_double(1.0) | K.value | K.value=2.0
import ctypes;;K=(ctypes.c_double*2)(1.0,2.0) | K[0] | K[0]=2.0
import datetime;;K=datetime.date(2000,1,1) | K.year*1.0 | K=datetime.date(2001,1,1)
def g():;;  g.n+=1;;  return 1.0;;g.n=0 | g() | pass
from numpy.polynomial import Polynomial;;K=Polynomial([1.0,2.0]) | K(1.0) | K.coef[0]=5.0
from numpy.polynomial import Polynomial;;K=Polynomial([1.0,2.0]) | K.coef[0] | K.coef[0]=5.0
class O(typing.NamedTuple):;;  x: float=1.0;;K=O() | K.x | K=O(2.0)
class O(typing.NamedTuple):;;  x: float=1.0;;  def __getitem__(s,i): return S[0];;S=[2.0];;K=O() | K[int(a)%1] | S[0]=3.0
class O(typing.NamedTuple):;;  x: float=1.0;;  def __len__(s): return int(S[0]);;S=[2.0];;K=O() | len(K) | S[0]=3.0
class O(typing.TypedDict):;;  x: float;;K=O(x=1.0) | K["x"] | K["x"]=2.0
class Co(complex):;;  @property;;  def real(s): return S[0];;S=[2.0];;K=Co(1,2) | K.real | S[0]=3.0
class O:;;  def __array__(s,*x,**k): return np.array([S[0]]);;S=[2.0];;K=O() | float(np.sum(K)) | S[0]=3.0
class O:;;  def __float__(s): return S[0];;S=[2.0];;K=O() | float(K) | S[0]=3.0
class O:;;  def __index__(s): return int(S[0]);;S=[2.0];;K=O() | (1.0,2.0,3.0,4.0)[K] | S[0]=3.0
class O:;;  def __getitem__(s,i): return S[0];;  def __len__(s): return 2;;S=[2.0];;K=O() | K[int(a)%2] | S[0]=3.0
class O:;;  def __iter__(s): return iter(S);;S=[2.0];;K=O() | sum(x for x in K) | S[0]=3.0
class O:;;  def __iter__(s): return iter(S);;S=[2.0,1.0];;K=O() | (lambda x,y: x)(*K) | S[0]=3.0
class O:;;  def __contains__(s,x): return S[0]>2.5;;S=[2.0];;K=O() | (1.0 if 1.0 in K else 2.0) | S[0]=3.0
class O:;;  def __contains__(s,x): return S[0]>2.5;;S=[2.0];;K=O() | (1.0 if a in K else 2.0) | S[0]=3.0
class L(tuple):;;  def __iter__(s): return iter(S);;S=[2.0,1.0];;K=L((7.0,8.0)) | (lambda x,y: x)(*K) | S[0]=3.0
class L(tuple):;;  def __iter__(s): return iter(S);;S=[2.0,1.0];;K=L((7.0,8.0)) | F.vec(*K)[0] | S[0]=3.0
class L(tuple):;;  def __iter__(s): return iter(S);;S=[2.0,1.0];;K=L((7.0,8.0)) | (lm.vec(a,a)@K) | S[0]=3.0
class L(tuple):;;  def __iter__(s): return iter(S);;S=[2.0,1.0];;K=L((7.0,8.0)) | lm.dot(K,lm.vec(a,a)) | S[0]=3.0
class L(dict):;;  def keys(s): return ["x"];;  def __iter__(s): return iter(["x","x"]);;K=L(x=1.0) | len(list(K)) | K["y"]=2.0
class L(list):;;  def __class_getitem__(c,i): return 2.0;;K=L | L[0] | L.__class_getitem__=classmethod(lambda c,i: 5.0)
class L(dict):;;  def items(s): return [("x",S[0])];;S=[2.0];;K=L(x=1.0) | sum(v for k,v in K.items()) | S[0]=3.0
class L(dict):;;  def values(s): return S;;S=[2.0];;K=L(x=1.0) | sum(K.values()) | S[0]=3.0
class Q(lm.Vec):;;  def __getitem__(s,i): return S[0];;S=[2.0];;K=Q(1.0,2.0) | K[int(a)%2] | S[0]=3.0
class Q(lm.Vec):;;  def __iter__(s): return iter(S);;S=[2.0,3.0];;K=Q(1.0,2.0) | (K@lm.vec(a,a)) | S[0]=5.0
K=F.tables.Table([1.0,2.0]) if hasattr(F,"tables") else [1.0] | K.array[0] if hasattr(K,"array") else K[0] | pass
""".strip("\n").split("\n")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    first, step = int(sys.argv[2]), int(sys.argv[3])
    for line in mistakes([*range(first, len(PROGRAMS), step)], Path(sys.argv[1]), True):
        print(line)
