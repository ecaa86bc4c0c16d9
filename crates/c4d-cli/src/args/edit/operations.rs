//! [`OperationFlags`]: options whose order matters.

use clap::{Arg, ArgAction, ArgMatches, Args, Command, Error, FromArgMatches};
use gs_edit::ACTION_OPTIONS;

/// Heading in the help.
const HEADING: &str = "Selection and actions, in order";

/// `--select`, `--replay` and the actions, in the order of the command line.
#[derive(Debug, Clone, Default)]
pub(crate) struct OperationFlags {
    /// Names without dashes, and arguments; empty for options without one.
    pub(crate) options: Vec<(String, String)>,
}

/// Name, placeholder of the argument, help.
fn options() -> impl Iterator<Item = (&'static str, Option<&'static str>, &'static str)> {
    let own = [
        ("select", Some("EXPR"), "Select the splats that the following actions change, see below"),
        ("replay", Some("FILE"), "Apply the steps of an earlier edit from its NAME.edit.json"),
    ];
    let actions = ACTION_OPTIONS.iter().map(|option| (option.name, option.argument, option.help));
    own.into_iter().chain(actions)
}

impl Args for OperationFlags {
    fn augment_args(command: Command) -> Command {
        options().fold(command, |command, (name, argument, help)| {
            let arg = Arg::new(name).long(name).help(help).help_heading(HEADING);
            let arg = arg.action(ArgAction::Append);
            command.arg(match argument {
                Some(placeholder) => {
                    arg.value_name(placeholder).allow_hyphen_values(true).num_args(1)
                }
                // A counted flag has no indices; an option with an implied value does.
                None => arg.num_args(0).default_missing_value(""),
            })
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for OperationFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let mut found: Vec<(usize, String, String)> = Vec::new();
        for (name, _, _) in options() {
            let positions = matches.indices_of(name).into_iter().flatten();
            let values = matches.get_many::<String>(name).into_iter().flatten();
            found.extend(
                positions.zip(values).map(|(at, value)| (at, name.to_owned(), value.clone())),
            );
        }
        found.sort();
        let options = found.into_iter().map(|(_, name, value)| (name, value)).collect();
        Ok(Self { options })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_keep_their_order() {
        let command = OperationFlags::augment_args(Command::new("edit"));
        let line = [
            "edit",
            "--hue",
            "30",
            "--select",
            "all",
            "--delete",
            "--translate",
            "-1,0,0",
            "--select",
            "moving",
            "--duplicate",
            "--hue",
            "-5",
        ];
        let found = OperationFlags::from_arg_matches(&command.get_matches_from(line)).unwrap();
        let names: Vec<_> = found.options.iter().map(|(n, v)| format!("{n} {v}")).collect();
        let expected = [
            "hue 30",
            "select all",
            "delete ",
            "translate -1,0,0",
            "select moving",
            "duplicate ",
            "hue -5",
        ];
        assert_eq!(names, expected, "in order, negative numbers included");
    }
}
