#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "context.h"

namespace dupin::cli {
namespace {

// One option of a verb as a shell sees it.
struct Word {
  std::vector<std::string> names;  // "-o", "--output"; empty: a positional
  std::vector<std::string> choices;
  std::string description;
  bool takes_value = false;
};

// A verb, or the program itself, with its path: "dupin synth surface".
struct Command {
  std::string path;
  std::string description;
  std::vector<std::string> subcommands;
  std::vector<Word> words;
};

// CLI11 keeps the values of IsMember in the name of the type only: "TEXT:{a,b,c}".
std::vector<std::string> choices_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const auto open = type.find('{');
  const auto close = type.find('}', open);
  if (open == std::string::npos || close == std::string::npos) return {};
  std::vector<std::string> choices;
  std::string choice;
  for (const char c : type.substr(open + 1, close - open - 1) + ",") {
    if (c != ',') {
      choice += c;
    } else if (!choice.empty()) {
      choices.push_back(choice);
      choice.clear();
    }
  }
  return choices;
}

void collect(const CLI::App& app, const std::string& path, std::vector<Command>& commands) {
  Command command{path, app.get_description(), {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    Word word;
    for (const std::string& name : option->get_snames()) word.names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) word.names.push_back("--" + name);
    word.choices = choices_of(*option);
    word.description = option->get_description();
    word.takes_value = option->get_items_expected_max() > 0;
    command.words.push_back(word);
  }
  const std::vector<const CLI::App*> children =
      app.get_subcommands([](const CLI::App*) { return true; });
  for (const CLI::App* child : children) command.subcommands.push_back(child->get_name());
  commands.push_back(command);
  for (const CLI::App* child : children) collect(*child, path + " " + child->get_name(), commands);
}

std::string joined(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, " "));
}

// In single quotes for any of the three shells; nothing here holds a line end.
std::string quoted(const std::string& text, bool is_fish = false) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\'') {
      result += is_fish ? "\\'" : "'\\''";
    } else {
      result += is_fish && c == '\\' ? "\\\\" : std::string(1, c);
    }
  }
  return result + "'";
}

// "'dupin a --x'|'dupin a -x'", the pattern of a case.
std::string pattern(const Command& command, const Word& word) {
  std::vector<std::string> patterns;
  for (const std::string& name : word.names) patterns.push_back(quoted(command.path + " " + name));
  return fmt::format("{}", fmt::join(patterns, "|"));
}

// The lines of a case that finds the verb among the words before the cursor.
std::string path_cases(const std::vector<Command>& commands, const char* indent) {
  std::string text;
  for (const Command& command : commands) {
    if (command.path == "dupin") continue;
    text += fmt::format("{0}{1}) command={1} ;;\n", indent, quoted(command.path));
  }
  return text;
}

std::vector<std::string> positional_choices(const Command& command) {
  std::vector<std::string> words = command.subcommands;
  for (const Word& word : command.words) {
    if (word.names.empty()) words.insert(words.end(), word.choices.begin(), word.choices.end());
  }
  return words;
}

std::string bash_script(const std::vector<Command>& commands) {
  std::string values;
  std::string options;
  std::string arguments;
  for (const Command& command : commands) {
    std::vector<std::string> names;
    for (const Word& word : command.words) {
      names.insert(names.end(), word.names.begin(), word.names.end());
      if (!word.takes_value || word.names.empty()) continue;
      values += fmt::format("    {}) choices={}; is_value=1 ;;\n", pattern(command, word),
                            quoted(joined(word.choices)));
    }
    options +=
        fmt::format("      {}) choices={} ;;\n", quoted(command.path), quoted(joined(names)));
    arguments += fmt::format("      {}) choices={} ;;\n", quoted(command.path),
                             quoted(joined(positional_choices(command))));
  }
  return fmt::format(R"(# Completion of dupin for bash: source <(dupin completion bash)
_dupin() {{
  local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD-1]}}
  local command=dupin choices= is_value= i
  if [[ $cur == = ]]; then cur=; elif [[ $prev == = ]]; then prev=${{COMP_WORDS[COMP_CWORD-2]}}; fi
  COMPREPLY=()
  for ((i = 1; i < COMP_CWORD; i++)); do
    case "$command ${{COMP_WORDS[i]}}" in
{}    esac
  done
  case "$command $prev" in
{}  esac
  if [[ -z $is_value && $cur == -* ]]; then
    case "$command" in
{}    esac
  elif [[ -z $is_value ]]; then
    case "$command" in
{}    esac
  fi
  # No choices: -o default completes file names.
  if [[ -n $choices ]]; then COMPREPLY=($(compgen -W "$choices" -- "$cur")); fi
}}
complete -o default -F _dupin dupin)",
                     path_cases(commands, "      "), values, options, arguments);
}

std::string described(const std::vector<std::pair<std::string, std::string>>& items) {
  std::vector<std::string> entries;
  for (const auto& [name, description] : items) entries.push_back(quoted(name + ":" + description));
  return fmt::format("{}", fmt::join(entries, " "));
}

std::string zsh_script(const std::vector<Command>& commands) {
  std::string values;
  std::string lists;
  for (const Command& command : commands) {
    std::vector<std::pair<std::string, std::string>> options;
    std::vector<std::pair<std::string, std::string>> arguments;
    for (const Word& word : command.words) {
      for (const std::string& name : word.names) options.emplace_back(name, word.description);
      for (const std::string& choice : word.choices) {
        if (word.names.empty()) arguments.emplace_back(choice, "");
      }
      if (!word.takes_value || word.names.empty()) continue;
      values += fmt::format("    {}) {}; return ;;\n", pattern(command, word),
                            word.choices.empty() ? "_files" : "compadd -- " + joined(word.choices));
    }
    for (const Command& child : commands) {
      const auto split = child.path.find_last_of(' ');
      if (split != std::string::npos && child.path.substr(0, split) == command.path) {
        arguments.emplace_back(child.path.substr(split + 1), child.description);
      }
    }
    lists += fmt::format("    {})\n      options=({})\n      arguments=({}) ;;\n",
                         quoted(command.path), described(options), described(arguments));
  }
  return fmt::format(R"(#compdef dupin
# Completion of dupin for zsh: source <(dupin completion zsh), after compinit
_dupin() {{
  local command=dupin i
  local -a options arguments
  for ((i = 2; i < CURRENT; i++)); do
    case "$command ${{words[i]}}" in
{}    esac
  done
  case "$command ${{words[CURRENT-1]}}" in
{}  esac
  case "$command" in
{}  esac
  if [[ ${{words[CURRENT]}} == -* ]]; then
    _describe -o option options
  elif (( ${{#arguments}} )); then
    _describe argument arguments
  else
    _files
  fi
}}
if [[ ${{funcstack[1]}} == _dupin ]]; then _dupin "$@"; else compdef _dupin dupin; fi)",
                     path_cases(commands, "      "), values, lists);
}

// Holds where the words before the cursor name this command and none below it.
std::string fish_condition(const Command& command, bool and_none_below) {
  std::string condition;
  std::string path = command.path;
  path.erase(0, std::string("dupin").size());
  for (std::size_t at = 0; at < path.size();) {
    const std::size_t end = std::min(path.find(' ', at + 1), path.size());
    condition += fmt::format("{}__fish_seen_subcommand_from {}", at == 0 ? "" : "; and ",
                             path.substr(at + 1, end - at - 1));
    at = end;
  }
  if (and_none_below && !command.subcommands.empty()) {
    condition += fmt::format("{}not __fish_seen_subcommand_from {}", path.empty() ? "" : "; and ",
                             joined(command.subcommands));
  }
  return quoted(condition, true);
}

std::string fish_script(const std::vector<Command>& commands) {
  std::string text =
      "# Completion of dupin for fish: dupin completion fish | source\n"
      "complete -c dupin -e";
  for (const Command& command : commands) {
    for (const Command& child : commands) {
      const auto split = child.path.find_last_of(' ');
      if (split == std::string::npos || child.path.substr(0, split) != command.path) continue;
      text += fmt::format("\ncomplete -c dupin -f -n {} -a {} -d {}", fish_condition(command, true),
                          child.path.substr(split + 1), quoted(child.description, true));
    }
    for (const Word& word : command.words) {
      std::string line = "\ncomplete -c dupin -n " + fish_condition(command, true);
      for (const std::string& name : word.names) {
        line += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      }
      if (!word.choices.empty()) {
        line += fmt::format(" {} -a {}", word.names.empty() ? "-f" : "-x",
                            quoted(joined(word.choices), true));
      } else if (word.names.empty()) {
        continue;  // a file name, which fish completes by itself
      } else if (word.takes_value) {
        line += " -r";
      }
      text += line + " -d " + quoted(word.description, true);
    }
  }
  return text;
}

}  // namespace

void add_completion(CLI::App& app, Context& context) {
  CLI::App* verb = app.add_subcommand("completion", "Print what makes a shell complete dupin");
  verb->footer(
      "Examples:\n"
      "  source <(dupin completion bash)\n"
      "  source <(dupin completion zsh)\n"
      "  dupin completion fish | source");
  add_global_options(*verb, context);
  auto shell = std::make_shared<std::string>();
  verb->add_option("SHELL", *shell, "Shell")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  verb->callback([shell, &app, &context] {
    std::vector<Command> commands;
    collect(app, "dupin", commands);
    const std::string script = *shell == "bash"  ? bash_script(commands)
                               : *shell == "zsh" ? zsh_script(commands)
                                                 : fish_script(commands);
    context.say(script);
    context.print_json({{"shell", *shell}, {"script", script}});
  });
}

}  // namespace dupin::cli
