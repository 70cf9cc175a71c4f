"""How it works, and where it differs from the paper

The cable law, the three webs and the studies come from the paper *Dynamic modelling and analysis of space webs*: truss
elements with the smooth compression-free law σ = E[(s + √(s² + 4η²))/2 − α], s = ε − ε0, where ε is the strain, ε0 the
slackness, a strain up to which a line stays slack, and η the smoothing, how round the kink between slack and taut is.
refweb evaluates it without cancellation. Elements are those of scikit-fem over natural arc length; forces are compiled
kernels, one for each effect, that every solver shares.

- **Statics** is Newton's method with a fictitious prestress that fades as it converges; a flat web without any tension
  needs no imperfection. Nets that are slack, or of lines 1 : 1e6 in stiffness, go to a primal–dual interior point on
  cones. Dynamic relaxation is the independent second way.
- **Dynamics** is central differences, or Runge–Kutta–Nyström splittings of order 4 and 6, in one compiled loop, with
  peaks found in every step and between steps; CVODE and IDA of SUNDIALS are the independent ways. Steps of every method
  end at each corner of each table over time: a pulse of any width gives its impulse.
- **± of statics** is proven with the tension-only law: a bound on every tension, on every stress and on the strain
  energy, from convex duality. On everything else it is what the residual and rounding leave, by the tangent. With the
  smooth law a second number says how far smoothing moves the value.
- **± of dynamics** is estimated from a twin, a second run of half the error: from how far the two are apart at the
  result and in the rows before it. It is wide for a peak of stress, where waves meet whose phases have few digits. Of a
  peak between steps it is no less than what that exceeds the values at steps by. The mean of the same stress over a
  window sums over these waves and has digits where the instant has none.
- **Books.** Energy and momentum are booked at every history row. A run whose energy drifts by more than 1 % is repeated
  with half the step, and never returned. Nor is one whose momentum is not that of its supports and loads: the impulse
  of dead loads and gravity is known from their tables, so that a pulse which steps have missed shows. Explicit methods
  close that book to rounding, at worst 1e-6, CVODE and IDA to rtol^(2/3); a free web closes that of angular momentum
  as well.
- **Horizon.** A motion that is chaotic has digits only for a while: a twin that starts 1e-12 beside finds for how long,
  and which results are statistical. An ensemble gives their mean and spread.
- **Elements.** Under nodal loads one straight element for each line is exact. Hit by a ball, the three webs'
  deflections have 1.7 to 2.1 digits with one element of order 1 for each line, 2.3 to 2.9 with two, 2.4 to 3.5 with one
  of order 2; their peak stresses have one to two digits whatever the elements are.
- **Refusals.** A load that nothing carries is refused, with the nodes and the direction in which it moves them. Parts
  that float between slack lines have no ± for their positions, and how far they can go in its place. Of a law whose
  slack lines push, the lower of two states comes back, with what it may lie above the lowest. Lines that get too deep
  into a body end the run.

Where the paper and its own webs differ: its hexagon web has 5165 elements, not 5156; N layers of hexagons have
3N² − 3N + 1 cells and 9N² − 3N elements, where section 3.1.3 repeats the square's formulas; the hexagon's ratio of
length to area is the lowest of the three, not the highest; and the three webs of one cable length have 6.56, 6.67 and
6.88 m², not one area.

What choices cost: on a square web hit by a ball η = 1e-3 moves the deflection by 6 % and η = 1e-5 by 0.1 %, four
elements for each line by 1 % for seven times the time, half the step by 0.5 %. ``work_precision`` has the diagrams of
eight scenes of different character. ``python -m validation.cost.explicit``, ``validation.cost.implicit``,
``validation.cost.statics`` and ``validation.cost.effects`` print what steps, factorizations and effects cost.

**How far it goes.** One process and one thread carry a web as far as memory does. Five load steps of a web from flat,
with their bounds, take 12 factorizations by rslab of the square web at 118 803 unknowns, 13 of the triangle web at 120
300 and 22 of the hexagon web at 237 009, which hangs together by far fewer lines, and 10, 13 and 20 by SuperLU, which
comes with scipy: 9, 7 and 11 times the CPU time of one by SuperLU with rslab, 20, 18 and 28 times by SuperLU. Below 100
000 unknowns supernodes factorize, with or without rslab, and from there on, without it, fronts: one load then takes 6
(squares), 3.6 (triangles) and 4.8 times (hexagons) the CPU time of one by SuperLU, and 9.6, 11.9 and 16 times with
SuperLU itself. qdldl, which factorizes webs of less than 2000 unknowns, would take 28 to 36 times, and 48 where the CPU
has little cache. With rslab the square web takes 20 factorizations, 102 s and 3.2 GB at 747 003 unknowns, 21, 208 s and
6.1 GB at 1 465 803, and at a million cells, 1 998 000 lines and 2 994 003 unknowns, 23, 545 s and 12.5 GB, with
energies proven to 2e-14 of themselves. CPU time goes with unknowns to the power 1.25 from 365 403 on, and 1.36 from 118
803: larger webs take more steps. That of triangles goes with 1.25 from 30 150 to 120 300, and with 1.37 on to 368 025,
where it takes 18 factorizations and 1.8 GB: each costs by the power 1.1, and their number grows by the power 0.3. That
of hexagons goes with 1.28 from 237 009 to 2 929 509: 31, 371 s and 7.6 GB. Of the 12.5 GB the factor has 3.1 and needs
4.3 while it is made, beside 4 of web, pattern and analysis; at that rate two million cells would take 25. Memory is to
be counted by what is filled: where a process may have no more than 16 GB of addresses, a million cells end it, as
libraries ask for more than they use. Explicit steps need no matrix: of the million cells a thousand take 27 s, 14 ns an
element and step, and 1.3 GB, with a set-up of 5 s; both go with unknowns to the power 1.1. Of hexagons, which have more
nodes for each line, an element and step takes 24 ns at 747 252 lines: out of the cache the time is that of memory. A
single web larger than a machine is a matter for PETSc: its SNES with the same tangents, spread over machines, and
conjugate gradients with a multigrid of the soft modes, or MUMPS, in place of the factor. ``python -m
validation.cost.scale`` prints these figures for a machine.
"""
