# Strict arithmetic: the same IEEE operations in the same order on every compiler, so that decoders agree to the bit.
function(use_strict_arithmetic target)
  target_compile_definitions(${target} PRIVATE EIGEN_DONT_VECTORIZE EIGEN_MPL2_ONLY)
  if(MSVC)
    target_compile_options(${target} PRIVATE /fp:precise)
  else()
    target_compile_options(${target} PRIVATE -ffp-contract=off -fno-fast-math -fno-math-errno -fno-trapping-math)
  endif()
endfunction()
