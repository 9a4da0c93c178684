// Damping for wanted ratios.

#include <dashpot/analysis/damping_sampled.hpp>
#include <dashpot/python/src/shared.hpp>

namespace dashpot::python {

analysis::DampingStructure structure_of(const std::string& name) {
  if (name == "full") return analysis::DampingStructure::kFull;
  if (name == "block") return analysis::DampingStructure::kBlock;
  if (name == "diagonal") return analysis::DampingStructure::kDiagonal;
  throw std::invalid_argument("structure: '" + name + "' is not one of full, block, diagonal");
}

namespace {

using analysis::DampingDesign;
using analysis::DampingMiss;
using analysis::DampingStructure;
using analysis::DampingTarget;

nb::dict entries_of(const DampingDesign& design) {
  nb::dict result;
  result["damping"] = to_array(design.damping);
  result["modes"] = modes_of(design.spectrum);
  result["misses"] = to_list(design.misses, [](const DampingMiss& miss) {
    return nb::make_tuple(miss.mode, miss.natural_frequency, miss.wanted, miss.obtained,
                          to_text(miss.reason));
  });
  result["indefinite_by"] = design.indefinite_by;
  return result;
}

/// Designs with the closed form if the request allows it.
DampingDesign design_continuous(const analysis::TaskImpedance& impedance,
                                const DampingTarget& target, DampingStructure structure,
                                const OptionalMatrix& start) {
  if (structure == DampingStructure::kFull && !start) {
    return analysis::design_damping(impedance, target);
  }
  return analysis::design_damping(impedance, target, structure, start);
}

nb::dict design(const analysis::TaskImpedance& impedance, double ratio, double soft_frequency,
                const std::string& structure_name, const OptionalMatrix& start,
                const std::optional<analysis::SampledLoop>& loop, double gain_margin) {
  const DampingTarget target{ratio, soft_frequency};
  const DampingStructure structure = structure_of(structure_name);
  if (!loop) {
    std::optional<DampingDesign> found;
    {
      const nb::gil_scoped_release release;
      found = design_continuous(impedance, target, structure, start);
    }
    return entries_of(*found);
  }
  std::optional<analysis::SampledDamping> found;
  {
    const nb::gil_scoped_release release;
    found = analysis::design_damping(impedance, target, {*loop, gain_margin}, structure, start);
  }
  nb::dict result = entries_of(found->design);
  nb::dict sampled = sampled_modes_of(found->sampled);
  sampled["gain_margin"] = found->gain_margin;
  sampled["continuous"] = modes_of(found->design.spectrum);
  result["sampled"] = sampled;
  result["level"] = found->level;
  result["kept"] = found->kept;
  return result;
}

}  // namespace

void add_design(nb::module_& m) {
  m.def("design_damping", &design, nb::arg("impedance"), nb::arg("ratio"),
        nb::arg("soft_frequency"), nb::arg("structure"), nb::arg("start").none(),
        nb::arg("loop").none(), nb::arg("gain_margin"));
}

}  // namespace dashpot::python
