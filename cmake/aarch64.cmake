# Compiles for 64-bit ARM under Linux on another machine: apt-get install g++-aarch64-linux-gnu. `make wheel-aarch64`.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
