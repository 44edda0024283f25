# Configures and builds the programs by the preset "odr", whose link fails where two units define one name differently.
cmake_host_system_information(RESULT cores QUERY NUMBER_OF_LOGICAL_CORES)
foreach(step "--preset;odr" "--build;--preset;odr;--target;narpa;narpa-dynamics;narpa-navigation;--parallel;${cores}")
  execute_process(COMMAND ${CMAKE_COMMAND} ${step} WORKING_DIRECTORY $ENV{NARPA_SOURCE_DIR} COMMAND_ERROR_IS_FATAL ANY)
endforeach()
