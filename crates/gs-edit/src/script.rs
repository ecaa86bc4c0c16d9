//! [`Script`]: selections and actions in order.

use crate::action::Action;
use crate::error::EditError;
use crate::resources::ResourceNames;
use crate::selector::Selector;

/// One step.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Step {
    /// Selects the splats that the following actions change.
    Select(Selector),
    /// Changes the selected splats.
    Act(Action),
}

/// Steps in order. Before the first selection, everything is selected.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Script {
    /// The steps.
    pub steps: Vec<Step>,
}

impl Script {
    /// Parses options of the command line: pairs of a name without dashes and its argument (empty
    /// if there is none). `select` takes an expression, the others are [`crate::ACTION_OPTIONS`].
    ///
    /// # Errors
    /// At the first option that is unknown or malformed.
    pub fn parse<'a>(
        options: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, EditError> {
        let mut steps = Vec::new();
        for (name, text) in options {
            match name {
                "select" => {
                    let selector = Selector::parse(text)
                        .map_err(|source| EditError::Syntax { option: name.to_owned(), source })?;
                    steps.push(Step::Select(selector));
                }
                "sliced" => match steps.last_mut() {
                    Some(Step::Act(Action::MatchColors { sliced, .. })) => *sliced = true,
                    _ => {
                        return Err(EditError::Modifier {
                            modifier: "sliced",
                            action: "match-colors",
                        });
                    }
                },
                _ => steps.push(Step::Act(Action::parse(name, text)?)),
            }
        }
        Ok(Self { steps })
    }

    /// The resources that the steps use.
    pub fn needs(&self) -> ResourceNames {
        let mut needs = ResourceNames::default();
        for step in &self.steps {
            match step {
                Step::Select(selector) => selector.visit(&mut |selector| match selector {
                    Selector::Moving | Selector::Part(_) => needs.motion = true,
                    Selector::Mask(path) => {
                        needs.masks.insert(path.clone());
                    }
                    Selector::Ids(path) => {
                        needs.ids.insert(path.clone());
                    }
                    _ => {}
                }),
                Step::Act(Action::MatchColors { image, .. } | Action::Style { image, .. }) => {
                    needs.images.insert(image.clone());
                }
                Step::Act(Action::Graft { file, .. }) => {
                    needs.splats.insert(file.clone());
                }
                Step::Act(_) => {}
            }
        }
        needs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_resources_are_collected_at_every_depth() {
        let script = Script::parse([
            ("select", "!(mask a | grow 1 (ids b & connected 0,0,0 of part 2))"),
            ("match-colors", "c.png"),
            ("sliced", ""),
            ("graft", "d.ply@0,0,0"),
        ])
        .unwrap();
        let needs = script.needs();
        assert!(needs.motion, "part");
        let names =
            |set: &std::collections::BTreeSet<String>| set.iter().cloned().collect::<String>();
        let found = [&needs.masks, &needs.ids, &needs.images, &needs.splats].map(names);
        assert_eq!(found, ["a", "b", "c.png", "d.ply"], "files");
        assert!(
            matches!(&script.steps[1], Step::Act(Action::MatchColors { sliced: true, .. })),
            "modified"
        );
    }

    #[test]
    fn modifiers_without_their_action_are_errors() {
        for options in
            [vec![("sliced", "")], vec![("match-colors", "a"), ("delete", ""), ("sliced", "")]]
        {
            let error = Script::parse(options).unwrap_err();
            assert!(matches!(error, EditError::Modifier { .. }), "{error}");
        }
    }
}
