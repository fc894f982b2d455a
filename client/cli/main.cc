#include "client/cli/command.h"

int main(int argc, char** argv) { return romap::cli::RunCli(argc, argv); }
