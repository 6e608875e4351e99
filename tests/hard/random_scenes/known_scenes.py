"""Scenes that ended wrongly once, of an earlier generator, as they were."""

from .blueprint import Blueprint, Clamp, CompliancePlan, ForcePlan, JointPlan, LinkPlan, MotorPlan, SpringPlan

STRETCHED_FOUR_BAR = Blueprint(
    topology="four-bar",
    links=(
        LinkPlan(name="base", fixed=True),
        LinkPlan(name="crank"),
        LinkPlan(
            name="coupler",
            centreline=((-3.84415754, 5.53870365), (1.05111381, 5.31769461), (5.68874316, 6.90038869)),
            thickness=0.130911496,
            depth=0.25140542,
            young=1.9,
            poisson=0.475,
            size=0.195424744,
        ),
        LinkPlan(
            name="rocker",
            centreline=((9.13181874, 0.449239575), (8.88915408, 4.46411103), (5.68874316, 6.90038869)),
            thickness=0.192477287,
            depth=0.570380621,
            young=0.2,
            poisson=0.49,
            size=0.188393398,
        ),
    ),
    joints=(
        JointPlan(name="joint A", kind="revolute", a="base", b="crank", at=(0.0, 0.0)),
        JointPlan(
            name="joint B", kind="revolute", a="crank", b="coupler", at=(-3.84415754, 5.53870365), interface=0.122358024
        ),
        JointPlan(
            name="joint C", kind="revolute", a="coupler", b="rocker", at=(5.68874316, 6.90038869), interface=0.074883134
        ),
        JointPlan(
            name="joint D", kind="revolute", a="base", b="rocker", at=(9.13181874, 0.449239575), interface=0.141865241
        ),
    ),
    motors=(MotorPlan(joint="joint A", position=-0.461800203),),
    forces=(ForcePlan(name="load", on="crank", at=(-3.13161978, 3.83179685), direction=(-0.709308856, 0.704897827)),),
    effects=(CompliancePlan(joint="joint B", compliance=2758.55983),),
    space="plane-stress",
    order=2,
    control="displacements",
    samples=(1.62973917e-05, 5.4324639e-05),
)

STRETCHED_COUPLER = Blueprint(
    topology="four-bar",
    links=(
        LinkPlan(name="base", fixed=True),
        LinkPlan(name="crank"),
        LinkPlan(
            name="coupler",
            centreline=((-5.03515304, 13.5139268), (35.9697622, 17.6839181)),
            thickness=0.498271929,
            depth=0.865606706,
            young=1.9,
            poisson=0.475,
            law="IsochoricSimoNeoHookean",
            size=0.582329699,
        ),
        LinkPlan(
            name="rocker",
            centreline=((19.6289245, 3.38267792), (29.4040893, 8.69968827), (35.9697622, 17.6839181)),
            thickness=0.557456128,
            depth=1.30890077,
            young=1.9,
            poisson=0.475,
            law="IsochoricSimoNeoHookean",
            size=0.554347688,
        ),
    ),
    joints=(
        JointPlan(name="joint A", kind="revolute", a="base", b="crank", at=(0.0, 0.0)),
        JointPlan(
            name="joint B", kind="revolute", a="crank", b="coupler", at=(-5.03515304, 13.5139268), interface=0.440567414
        ),
        JointPlan(
            name="joint C", kind="weld", a="coupler", b="rocker", at=(35.9697622, 17.6839181), interface=0.407319882
        ),
        JointPlan(
            name="joint D", kind="revolute", a="base", b="rocker", at=(19.6289245, 3.38267792), interface=0.404104107
        ),
    ),
    motors=(),
    forces=(ForcePlan(name="load", on="rocker", at=(19.6289245, 3.38267792), direction=(0.459372279, 0.888243835)),),
    effects=(CompliancePlan(joint="joint C", compliance=262060.815),),
    space="plane-strain",
    order=1,
    control="displacements",
    samples=(0.00505061559, 0.0168353853),
)

CLAMPED_ARCH = Blueprint(
    topology="two-link arch",
    links=(
        LinkPlan(name="base", fixed=True),
        LinkPlan(
            name="left",
            centreline=((0.0, 0.0), (20.5332085, -2.37752059), (36.4003122, 10.870131)),
            thickness=1.8001326,
            depth=3.63913407,
            young=1770.0,
            poisson=0.42,
            size=2.14685031,
        ),
        LinkPlan(name="right"),
    ),
    joints=(
        JointPlan(
            name="joint A",
            kind="weld",
            a="base",
            b="left",
            at=(0.0, 0.0),
            interface=Clamp(length=2.29423311, width=2.7001989, angle=-0.115275703),
        ),
        JointPlan(
            name="joint B", kind="revolute", a="left", b="right", at=(36.4003122, 10.870131), interface=1.2850937
        ),
        JointPlan(name="joint C", kind="revolute", a="base", b="right", at=(87.8796258, -3.72819976)),
    ),
    motors=(),
    forces=(ForcePlan(name="load", on="right", at=(66.9823572, 0.478459204), direction=(-0.695379122, 0.71864308)),),
    effects=(),
    space="plane-stress",
    order=1,
    control="displacements",
    samples=(4.49806852,),
)

LIMIT_OF_A_LED_FORCE = Blueprint(
    topology="slider-crank",
    links=(
        LinkPlan(name="base", fixed=True),
        LinkPlan(name="crank"),
        LinkPlan(
            name="rod",
            centreline=((24.4084202, 27.0918962), (66.9342263, 29.2285387), (101.914437, 4.95109502)),
            thickness=6.63180932,
            depth=6.12305403,
            young=0.2,
            poisson=0.49,
            law="IsochoricSimoNeoHookean",
            size=9.88352813,
        ),
        LinkPlan(name="slider"),
    ),
    joints=(
        JointPlan(name="joint A", kind="revolute", a="base", b="crank", at=(0.0, 0.0)),
        JointPlan(
            name="joint B", kind="revolute", a="crank", b="rod", at=(24.4084202, 27.0918962), interface=5.77402026
        ),
        JointPlan(
            name="joint C", kind="revolute", a="rod", b="slider", at=(101.914437, 4.95109502), interface=4.16313993
        ),
        JointPlan(
            name="joint S",
            kind="prismatic",
            a="base",
            b="slider",
            at=(105.72272, -2.66547112),
            axis=(0.981155683, -0.193218856),
        ),
    ),
    motors=(),
    forces=(ForcePlan(name="load", on="crank", at=(27.7514509, 6.47451068), direction=(-0.56485935, -0.8251872)),),
    effects=(SpringPlan(joint="joint S", stiffness=6.28231162e-06, rest=0.0),),
    space="plane-strain",
    order=2,
    control="forces",
    samples=(0.0104929845,),
)

LIMIT_OF_A_CONSTANT_FORCE = Blueprint(
    topology="slider-crank",
    links=(
        LinkPlan(name="base", fixed=True),
        LinkPlan(
            name="crank",
            centreline=((0.0, 0.0), (3.51812752, 51.2474354)),
            thickness=1.66613712,
            depth=2.12305539,
            young=1770.0,
            poisson=0.42,
            size=2.28705711,
        ),
        LinkPlan(
            name="rod",
            centreline=((3.51812752, 51.2474354), (114.32809, -103.77617)),
            thickness=1.09737798,
            depth=2.18579295,
            young=1770.0,
            poisson=0.42,
            size=1.48135237,
        ),
        LinkPlan(name="slider"),
    ),
    joints=(
        JointPlan(name="joint A", kind="revolute", a="base", b="crank", at=(0.0, 0.0), interface=0.93163633),
        JointPlan(
            name="joint B", kind="revolute", a="crank", b="rod", at=(3.51812752, 51.2474354), interface=0.652186425
        ),
        JointPlan(name="joint C", kind="weld", a="rod", b="slider", at=(114.32809, -103.77617), interface=0.894370727),
        JointPlan(
            name="joint S",
            kind="prismatic",
            a="base",
            b="slider",
            at=(123.236496, -121.592982),
            axis=(0.951726241, -0.306948144),
        ),
    ),
    motors=(),
    forces=(
        ForcePlan(name="load", on="rod", at=(101.648843, -86.0378491), direction=(-0.788826813, -0.614615537)),
        ForcePlan(
            name="second load",
            on="crank",
            at=(3.27309239, 47.6780871),
            direction=(0.747904221, -0.663806656),
            magnitude=0.00373946489,
        ),
    ),
    effects=(),
    space="plane-stress",
    order=2,
    control="displacements",
    samples=(11.2810662,),
)

SOFT_SPRING = Blueprint(
    topology="Watt six-bar",
    links=(
        LinkPlan(name="base", fixed=True),
        LinkPlan(
            name="crank",
            centreline=((0.0, 0.0), (3.337226300575068, 65.61440641818885), (51.64068897628737, 110.14712363293535)),
            thickness=1.6183696127672973,
            depth=0.970110946795341,
            young=0.2,
            poisson=0.49,
            size=1.814207463732226,
        ),
        LinkPlan(
            name="coupler",
            centreline=(
                (51.64068897628737, 110.14712363293535),
                (149.8392984018652, 140.61069351777388),
                (252.21745060721375, 131.13916068173762),
            ),
            thickness=2.254956068684027,
            depth=4.703712942872002,
            young=1770.0,
            poisson=0.42,
            size=2.0895125025933936,
        ),
        LinkPlan(
            name="rocker",
            centreline=(
                (229.79241594582666, 3.6271794089879474),
                (252.21745060721375, 131.13916068173762),
                (271.1008448617484, 197.27000348200528),
            ),
            thickness=2.3684808169108136,
            depth=4.246634212878357,
            young=1770.0,
            poisson=0.42,
            size=3.3164279792787106,
        ),
        LinkPlan(
            name="second coupler",
            centreline=((271.1008448617484, 197.27000348200528), (404.73684687519915, 216.7310848547263)),
            thickness=1.5413449298414867,
            depth=3.258202178682985,
            young=0.2,
            poisson=0.49,
            size=1.8552691786060558,
        ),
        LinkPlan(name="second rocker"),
    ),
    joints=(
        JointPlan(name="joint A", kind="revolute", a="base", b="crank", at=(0.0, 0.0), interface=1.092763235197559),
        JointPlan(
            name="joint B",
            kind="revolute",
            a="crank",
            b="coupler",
            at=(51.64068897628737, 110.14712363293535),
            interface=1.2636052059605265,
        ),
        JointPlan(
            name="joint C",
            kind="revolute",
            a="coupler",
            b="rocker",
            at=(252.21745060721375, 131.13916068173762),
            interface=1.8924732892006724,
        ),
        JointPlan(
            name="joint D",
            kind="revolute",
            a="base",
            b="rocker",
            at=(229.79241594582666, 3.6271794089879474),
            interface=2.1570391072996156,
        ),
        JointPlan(
            name="joint E",
            kind="revolute",
            a="rocker",
            b="second coupler",
            at=(271.1008448617484, 197.27000348200528),
            interface=1.3853787263940345,
        ),
        JointPlan(
            name="joint F",
            kind="revolute",
            a="second coupler",
            b="second rocker",
            at=(404.73684687519915, 216.7310848547263),
            interface=0.9870088669278615,
        ),
        JointPlan(
            name="joint G", kind="revolute", a="base", b="second rocker", at=(410.77424775680606, 92.38456963607946)
        ),
    ),
    motors=(),
    forces=(
        ForcePlan(
            name="load",
            on="second coupler",
            at=(304.6101692279644, 202.1498837418936),
            direction=(-0.7450582835008579, 0.6669993659567865),
        ),
    ),
    effects=(SpringPlan(joint="joint D", stiffness=0.00012171256118611828, rest=-0.2855929340532185),),
    space="plane-stress",
    order=2,
    control="forces",
    samples=(1.4760791909003698e-09, 4.920263969667899e-09),
)
