"""An error source: struts that are longer by b ((L - L0) / h)² with one b for all."""

from dbbstation.sources.contract import SMOOTH_MM, Effect, LinearSource, Owner, Parameter, Texts


class ExampleBow(LinearSource):
    """All scales are bowed alike."""

    name = "example-bow"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    texts = Texts(
        what="The scales of all struts are bowed alike.",
        shows="Circles are deformed, most where struts are long or short.",
        confirm="Measure the travel of a strut with a laser interferometer: the error is a parabola.",
        cure="Mount the scales anew.",
        equation="dL = b ((L - L0) / h)^2, L0 and h middle and half of the travel",
        origin="a rod bent to an arc is shorter than the arc by a square",
    )

    def parameters(self, machine):
        return (Parameter("bow_um", "µm", 50.0, "all struts at their ends"),)

    def derivative(self, motion, machine, values):
        shortest, longest = machine.travel.strut_mm
        place = (2.0 * motion.struts(machine).length_mm - shortest - longest) / (longest - shortest)
        return Effect(strut_mm=1e-3 * place[:, :, None] ** 2)
