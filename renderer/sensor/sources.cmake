target_sources(narpa_renderer PRIVATE sensor/dark_levels.cpp sensor/detector.cpp)
# Loops over sixteen lanes become vector code; GCC would first write out those that stand in another loop. No exception
# flag is looked at, so both sides of a choice may be computed.
set_source_files_properties(sensor/detector.cpp PROPERTIES COMPILE_OPTIONS
  "-O3;-fno-trapping-math;$<$<CXX_COMPILER_ID:GNU>:--param=max-completely-peel-times=8>")
