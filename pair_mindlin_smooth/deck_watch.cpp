// Copyright (C) 2026 The faultgouge developers
// SPDX-License-Identifier: GPL-2.0-only
//
// This program is free software under the terms of version 2 of the GNU General Public License; see the file LICENSE.

// Watches a LAMMPS that carries out a deck, so that nobody has to read the deck: LAMMPS itself tells its commands.
//
// LAMMPS echoes each line to its screen before it parses the line. The screen here is a stream of this program. When a
// line comes, Input still holds the words of the command before it, with variables filled in and without comments;
// these are handed on. All else that comes (thermodynamic output, what print and fix print write) is no line of Input.
//
// At `quit`, LAMMPS deletes its Output, closes screen and log, and exits. The screen is closed first: there the log is
// closed as LAMMPS would do, Output is made anew, and an exception leads out of LAMMPS, which goes on living.

#include "citeme.h"
#include "command.h"
#include "exceptions.h"
#include "input.h"
#include "lammps.h"
#include "modify.h"
#include "output.h"
#include "platform.h"
#include "update.h"

#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

using namespace LAMMPS_NS;

namespace {

typedef void (*Told)(int count, const char *const *words);

// Members of Input that are not public in all releases: an explicit instantiation may name them.
template <class NAMED, auto MEMBER> struct Opened {
  friend auto &member(NAMED, Input *input) { return input->*MEMBER; }
};
struct Line {
  friend auto &member(Line, Input *);
};
struct CommandName {
  friend auto &member(CommandName, Input *);
};
struct SeeksLabel {
  friend auto &member(SeeksLabel, Input *);
};
template struct Opened<Line, &Input::line>;
template struct Opened<CommandName, &Input::command>;
template struct Opened<SeeksLabel, &Input::label_active>;

struct Watch {
  LAMMPS *lmp;
  Told told;         // of each command that has been carried out
  void (*runs)();    // before the first run or minimize
  FILE *screen;
};

// LAMMPS makes a command by a function that gets nothing of ours: one deck at a time
Watch watch;
Input::CommandCreatorMap originals;

void tell_command()
{
  Input *input = watch.lmp->input;
  const char *command = member(CommandName(), input);
  if (!command) return;
  std::vector<const char *> words{command};
  words.insert(words.end(), input->arg, input->arg + input->narg);
  watch.told(static_cast<int>(words.size()), words.data());
}

ssize_t write_screen(void *, const char *text, size_t size)
{
  const char *line = member(Line(), watch.lmp->input);
  if (line && size == std::strlen(line) + 1 && std::memcmp(text, line, size - 1) == 0) tell_command();
  return static_cast<ssize_t>(size);
}

void close_log(LAMMPS *lmp)
{
  if (lmp->logfile) fclose(lmp->logfile);
  lmp->logfile = nullptr;
}

void leave_commands()
{
  for (const auto &[name, creator] : originals) (*watch.lmp->input->command_map)[name] = creator;
  originals.clear();
}

// The screen is closed: by `quit`, unless the watch has ended before.
int close_screen(void *)
{
  LAMMPS *lmp = watch.lmp;
  if (!lmp) return 0;
  lmp->screen = nullptr;
  close_log(lmp);
  for (const char *name : {"thermo_temp", "thermo_press", "thermo_pe"}) lmp->modify->delete_compute(name);
  lmp->output = new Output(lmp);
  lmp->update->whichflag = 0;    // a quit between the parts of `run ... every`
  throw LAMMPSException("faultgouge: the deck ends by quit");
}

template <int WHICH> Command *create_run(LAMMPS *lmp)
{
  const auto original = originals.at(WHICH == 0 ? "run" : "minimize");
  leave_commands();
  watch.runs();
  return original(lmp);
}

}    // namespace

#define EXPORTED extern "C" __attribute__((visibility("default")))

// Begin to watch an instance that has no screen, and echoes commands to it. On all ranks.
EXPORTED void faultgouge_watch(void *handle, Told told, void (*runs)())
{
  LAMMPS *lmp = static_cast<LAMMPS *>(handle);
  cookie_io_functions_t stream{};
  stream.write = write_screen;
  stream.close = close_screen;
  watch = {lmp, told, runs, fopencookie(nullptr, "w", stream)};
  setvbuf(watch.screen, nullptr, _IONBF, 0);
  member(CommandName(), lmp->input) = nullptr;    // none has been carried out
  lmp->screen = watch.screen;
  Input::CommandCreatorMap &commands = *lmp->input->command_map;
  originals = {{"run", commands.at("run")}, {"minimize", commands.at("minimize")}};
  commands["run"] = create_run<0>;
  commands["minimize"] = create_run<1>;
}

// End the watch and close the log as LAMMPS does. If the deck has come to its end, the last command is told, and the
// log gets the time that LAMMPS took. On all ranks.
EXPORTED void faultgouge_end_watch(void *handle, int complete)
{
  LAMMPS *lmp = static_cast<LAMMPS *>(handle);
  if (complete) tell_command();
  member(SeeksLabel(), lmp->input) = 0;    // without an end, LAMMPS would pass over all commands
  leave_commands();
  if (complete && lmp->citeme) lmp->citeme->flush();
  if (complete && lmp->logfile) {
    const int seconds = static_cast<int>(platform::walltime() - lmp->initclock);
    fprintf(lmp->logfile, "Total wall time: %d:%02d:%02d\n", seconds / 3600, seconds / 60 % 60, seconds % 60);
  }
  close_log(lmp);
  watch.lmp = nullptr;
  if (lmp->screen == watch.screen) {
    lmp->screen = nullptr;
    fclose(watch.screen);
  }
}
