#include "server/nerf/cpu/general_kernels-inl.h"
#include "server/nerf/cpu/kernels.h"

namespace romap::nerf {

const KernelTable& PlainKernels() {
  static const KernelTable table =
      plain::WithGeneralKernels<float, plain::OutputByRows, plain::Encode, plain::EncodeBackward>(
          plain::MakeKernelTable<float, plain::OutputByRows>("plain"));
  return table;
}

}  // namespace romap::nerf
