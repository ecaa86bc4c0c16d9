//! A pickle machine for checkpoints: data only.
//!
//! Containers are stored in an arena and values are small copies, so memory grows with the length
//! of the pickle, sharing costs nothing, and deep nesting is harmless. Objects of other classes
//! (NumPy scalars stored with the weights, whole modules) are inert: only the name of their class
//! and their state are kept, as data.

mod integers;
mod name;

use super::names;
use super::tensor::{Dtype, Tensor};
use super::{PthError, Root};
pub(crate) use integers::Integers;

use integers::long;
use name::{Name, name_of};
use std::borrow::Cow;
use std::collections::BTreeMap;

#[derive(Debug, Clone, Copy)]
enum Value<'a> {
    None,
    Bool(bool),
    Int(i64),
    /// A number or bytes that are not needed.
    Plain,
    Text(&'a str),
    Name(Name<'a>),
    /// Index into the arena.
    Node(usize),
    Mark,
}

#[derive(Debug)]
enum Node<'a> {
    Tuple(Vec<Value<'a>>),
    /// A list or a set.
    List(Vec<Value<'a>>),
    Dict(Vec<(Value<'a>, Value<'a>)>),
    Storage {
        dtype: Dtype,
        bytes: &'a [u8],
    },
    Tensor(Tensor<'a>),
    /// An object of the class `module.name`, with its state and items.
    Object {
        class: (&'a str, &'a str),
        state: Value<'a>,
        items: Vec<(Value<'a>, Value<'a>)>,
    },
}

/// Looks up the bytes of a storage by its key and its expected number of bytes.
type Storages<'a, 'f> = &'f dyn Fn(&str, usize) -> Option<&'a [u8]>;

struct Machine<'a, 'f> {
    bytes: &'a [u8],
    at: usize,
    stack: Vec<Value<'a>>,
    arena: Vec<Node<'a>>,
    memo: BTreeMap<u32, Value<'a>>,
    storages: Storages<'a, 'f>,
}

/// Runs the pickle and returns the tensors of its result, and the integers stored with them.
pub(super) fn load<'a>(
    bytes: &'a [u8],
    storages: Storages<'a, '_>,
) -> Result<(Root<'a>, Integers), PthError> {
    let mut machine = Machine::new(bytes, storages);
    while !machine.step()? {}
    let root = machine.pop()?;
    let integers = machine.integers(root);
    Ok((machine.root(root)?, integers))
}

/// Runs the pickle at the beginning of `bytes`; returns its length and the texts in it, in order.
pub(super) fn scan<'a>(
    bytes: &'a [u8],
    storages: Storages<'a, '_>,
) -> Result<(usize, Vec<&'a str>), PthError> {
    let mut machine = Machine::new(bytes, storages);
    let mut texts = Vec::new();
    loop {
        let before = machine.stack.len();
        let ended = machine.step()?;
        if let Some(Value::Text(text)) = machine.stack.get(before) {
            texts.push(*text);
        }
        if ended {
            return Ok((machine.at, texts));
        }
    }
}

impl<'a, 'f> Machine<'a, 'f> {
    fn new(bytes: &'a [u8], storages: Storages<'a, 'f>) -> Self {
        Self { bytes, at: 0, stack: Vec::new(), arena: Vec::new(), memo: BTreeMap::new(), storages }
    }

    fn error(&self, what: impl Into<String>) -> PthError {
        PthError::Pickle { at: self.at, what: what.into() }
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], PthError> {
        let end = self.at.checked_add(length).filter(|&end| end <= self.bytes.len());
        let end = end.ok_or_else(|| self.error("the pickle ends early"))?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, PthError> {
        Ok(self.take(1)?[0])
    }

    fn u32(&mut self) -> Result<u32, PthError> {
        let raw = self.take(4)?;
        Ok(u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]))
    }

    fn text(&mut self, length: usize) -> Result<&'a str, PthError> {
        let raw = self.take(length)?;
        std::str::from_utf8(raw).map_err(|error| self.error(format!("text: {error}")))
    }

    /// A line of a GLOBAL.
    fn line(&mut self) -> Result<&'a str, PthError> {
        let length = self.bytes[self.at..].iter().take(256).position(|&byte| byte == b'\n');
        let length = length.ok_or_else(|| self.error("an unterminated name"))?;
        let line = self.text(length)?;
        self.at += 1;
        Ok(line)
    }

    fn pop(&mut self) -> Result<Value<'a>, PthError> {
        match self.stack.pop() {
            Some(Value::Mark) | None => Err(self.error("a value is missing on the stack")),
            Some(value) => Ok(value),
        }
    }

    fn pop_to_mark(&mut self) -> Result<Vec<Value<'a>>, PthError> {
        let mark = self.stack.iter().rposition(|value| matches!(value, Value::Mark));
        let mark = mark.ok_or_else(|| self.error("a mark is missing on the stack"))?;
        let values = self.stack.split_off(mark + 1);
        self.stack.pop();
        Ok(values)
    }

    fn push_node(&mut self, node: Node<'a>) {
        self.arena.push(node);
        self.stack.push(Value::Node(self.arena.len() - 1));
    }

    fn tuple(&self, value: Value<'a>) -> Result<&[Value<'a>], PthError> {
        match value {
            Value::Node(index) => match &self.arena[index] {
                Node::Tuple(values) => Ok(values),
                _ => Err(self.error("expected a tuple")),
            },
            _ => Err(self.error("expected a tuple")),
        }
    }

    fn top_dict(&mut self) -> Result<&mut Vec<(Value<'a>, Value<'a>)>, PthError> {
        let at = self.at;
        if let Some(&Value::Node(index)) = self.stack.last()
            && let Node::Dict(items) | Node::Object { items, .. } = &mut self.arena[index]
        {
            return Ok(items);
        }
        Err(PthError::Pickle { at, what: "expected a dictionary on the stack".to_owned() })
    }

    /// Appends to the list at the top of the stack; items of other objects are not needed.
    fn append(&mut self, values: &[Value<'a>]) -> Result<(), PthError> {
        let at = self.at;
        if let Some(&Value::Node(index)) = self.stack.last() {
            match &mut self.arena[index] {
                Node::List(items) => {
                    items.extend_from_slice(values);
                    return Ok(());
                }
                Node::Object { .. } => return Ok(()),
                _ => {}
            }
        }
        Err(PthError::Pickle { at, what: "expected a list on the stack".to_owned() })
    }

    /// The pairs of a list of lists, from which Python 2 makes ordered dictionaries.
    fn pairs(&self, list: Value<'a>) -> Result<Vec<(Value<'a>, Value<'a>)>, PthError> {
        let items = |value: &Value<'a>| match value {
            Value::Node(index) => match &self.arena[*index] {
                Node::List(items) | Node::Tuple(items) => Some(items),
                _ => None,
            },
            _ => None,
        };
        let pair = |value: &Value<'a>| match items(value)?[..] {
            [key, value] => Some((key, value)),
            _ => None,
        };
        items(&list)
            .and_then(|all| all.iter().map(pair).collect())
            .ok_or_else(|| self.error("a dictionary whose items are not pairs"))
    }

    /// Executes one opcode; true after STOP.
    fn step(&mut self) -> Result<bool, PthError> {
        let opcode = self.byte()?;
        match opcode {
            0x80 => {
                let protocol = self.byte()?;
                if protocol > 5 {
                    return Err(self.error(format!("unknown pickle protocol {protocol}")));
                }
            }
            b'.' => return Ok(true),
            b'(' => self.stack.push(Value::Mark),
            b'N' => self.stack.push(Value::None),
            0x88 | 0x89 => self.stack.push(Value::Bool(opcode == 0x88)),
            b'K' => {
                let value = self.byte()?;
                self.stack.push(Value::Int(value.into()));
            }
            b'M' => {
                let raw = self.take(2)?;
                self.stack.push(Value::Int(u16::from_le_bytes([raw[0], raw[1]]).into()));
            }
            b'J' => {
                let value = self.u32()?.cast_signed();
                self.stack.push(Value::Int(value.into()));
            }
            0x8a => {
                let length = usize::from(self.byte()?);
                let raw = self.take(length)?;
                self.stack.push(long(raw).map_or(Value::Plain, Value::Int));
            }
            b'G' => {
                self.take(8)?;
                self.stack.push(Value::Plain);
            }
            b'X' => {
                let length = self.u32()? as usize;
                self.push_text(length)?;
            }
            0x8c => {
                let length = usize::from(self.byte()?);
                self.push_text(length)?;
            }
            b'C' => {
                let length = usize::from(self.byte()?);
                self.take(length)?;
                self.stack.push(Value::Plain);
            }
            // Strings of Python 2, which may be bytes.
            b'U' | b'T' => {
                let length = if opcode == b'U' { self.byte()?.into() } else { self.u32()? };
                let text = std::str::from_utf8(self.take(length as usize)?);
                self.stack.push(text.map_or(Value::Plain, Value::Text));
            }
            // Bytes, and integers of more than 255 bytes.
            b'B' | 0x8b => {
                let length = self.u32()? as usize;
                self.take(length)?;
                self.stack.push(Value::Plain);
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.stack.push(Value::Name(name_of(module, name)));
            }
            0x93 => {
                let (name, module) = (self.pop()?, self.pop()?);
                let (Value::Text(module), Value::Text(name)) = (module, name) else {
                    return Err(self.error("a name that is not text"));
                };
                self.stack.push(Value::Name(name_of(module, name)));
            }
            // The length of a frame, which is not needed in memory.
            0x95 => {
                self.take(8)?;
            }
            b')' => self.push_node(Node::Tuple(Vec::new())),
            b't' => {
                let values = self.pop_to_mark()?;
                self.push_node(Node::Tuple(values));
            }
            0x85..=0x87 => {
                let mut values = Vec::new();
                for _ in 0x84..opcode {
                    values.push(self.pop()?);
                }
                values.reverse();
                self.push_node(Node::Tuple(values));
            }
            b'}' => self.push_node(Node::Dict(Vec::new())),
            b']' | 0x8f => self.push_node(Node::List(Vec::new())),
            0x91 => {
                let values = self.pop_to_mark()?;
                self.push_node(Node::List(values));
            }
            b'0' => {
                self.pop()?;
            }
            b'a' => {
                let value = self.pop()?;
                self.append(&[value])?;
            }
            b'e' | 0x90 => {
                let values = self.pop_to_mark()?;
                self.append(&values)?;
            }
            b's' => {
                let (value, key) = (self.pop()?, self.pop()?);
                self.top_dict()?.push((key, value));
            }
            b'u' => {
                let values = self.pop_to_mark()?;
                if values.len() % 2 == 1 {
                    return Err(self.error("a key without a value"));
                }
                let items = self.top_dict()?;
                items.extend(values.as_chunks::<2>().0.iter().map(|&[key, value]| (key, value)));
            }
            b'q' => {
                let key = self.byte()?;
                self.memoize(key.into())?;
            }
            b'r' => {
                let key = self.u32()?;
                self.memoize(key)?;
            }
            b'h' => {
                let key = self.byte()?;
                self.recall(key.into())?;
            }
            b'j' => {
                let key = self.u32()?;
                self.recall(key)?;
            }
            0x94 => {
                let key = u32::try_from(self.memo.len())
                    .map_err(|error| self.error(format!("memo: {error}")))?;
                self.memoize(key)?;
            }
            b'Q' => self.persistent()?,
            b'R' | 0x81 => self.reduce()?,
            b'b' => self.build()?,
            other => {
                return Err(self.error(format!(
                    "opcode 0x{other:02x}, which checkpoints do not use; refused"
                )));
            }
        }
        Ok(false)
    }

    fn memoize(&mut self, key: u32) -> Result<(), PthError> {
        match self.stack.last() {
            Some(Value::Mark) | None => Err(self.error("no value to memoize")),
            Some(&value) => {
                self.memo.insert(key, value);
                Ok(())
            }
        }
    }

    fn recall(&mut self, key: u32) -> Result<(), PthError> {
        let value = self.memo.get(&key).copied();
        let value = value.ok_or_else(|| self.error(format!("unknown memo {key}")))?;
        self.stack.push(value);
        Ok(())
    }

    fn push_text(&mut self, length: usize) -> Result<(), PthError> {
        let text = self.text(length)?;
        self.stack.push(Value::Text(text));
        Ok(())
    }

    /// Stores the state of an inert object; the state of an ordered
    /// dictionary is module metadata and is dropped.
    fn build(&mut self) -> Result<(), PthError> {
        let given = self.pop()?;
        if let Some(&Value::Node(index)) = self.stack.last()
            && let Node::Object { state, .. } = &mut self.arena[index]
        {
            *state = given;
            return Ok(());
        }
        self.top_dict().map(|_items| ())
    }

    fn push_object(&mut self, module: &'a str, name: &'a str) {
        self.push_node(Node::Object {
            class: (module, name),
            state: Value::None,
            items: Vec::new(),
        });
    }

    /// Resolves `('storage', class, key, device, count)` to the bytes of that storage; the device
    /// is ignored. The legacy format adds a view, which is `None` in files that are in use.
    fn persistent(&mut self) -> Result<(), PthError> {
        let id = self.pop()?;
        // For unsupported number types the tensor is inert.
        if let &[Value::Text("storage"), Value::Name(Name::Other(module, name)), ..] =
            self.tuple(id)?
        {
            self.push_object(module, name);
            return Ok(());
        }
        let &[
            Value::Text("storage"),
            Value::Name(Name::Storage(dtype)),
            Value::Text(key),
            _,
            Value::Int(count),
            ref view @ ..,
        ] = self.tuple(id)?
        else {
            return Err(self.error("a persistent id that is not a storage"));
        };
        if !matches!(view, [] | [Value::None]) {
            return Err(self.error("a view of a storage, which is not supported"));
        }
        let length = usize::try_from(count).ok().and_then(|count| count.checked_mul(dtype.size()));
        let stored = (self.storages)(key, length.unwrap_or(usize::MAX))
            .ok_or_else(|| PthError::MissingEntry(format!("data/{key}")))?;
        let bytes = length.and_then(|length| stored.get(..length)).ok_or_else(|| {
            PthError::Tensor(format!(
                "storage {key} should hold {count} elements of {} bytes, found {} bytes",
                dtype.size(),
                stored.len()
            ))
        })?;
        self.push_node(Node::Storage { dtype, bytes });
        Ok(())
    }

    fn reduce(&mut self) -> Result<(), PthError> {
        let (arguments, callable) = (self.pop()?, self.pop()?);
        let Value::Name(name) = callable else {
            return Err(self.error("a call of an object without a name"));
        };
        let arguments = self.tuple(arguments)?;
        match (name, arguments) {
            (Name::Other(module, name), _) => {
                self.push_object(module, name);
                Ok(())
            }
            (Name::OrderedDict, []) => {
                self.push_node(Node::Dict(Vec::new()));
                Ok(())
            }
            (Name::OrderedDict, &[list]) => {
                let pairs = self.pairs(list)?;
                self.push_node(Node::Dict(pairs));
                Ok(())
            }
            (Name::RebuildParameter, &[tensor, ..]) => {
                self.stack.push(tensor);
                Ok(())
            }
            (Name::RebuildTensor, &[storage, offset, shape, strides, ..]) => {
                if let Value::Node(index) = storage
                    && let Node::Object { class: (module, name), .. } = self.arena[index]
                {
                    self.push_object(module, name);
                    return Ok(());
                }
                let tensor = self.tensor(storage, offset, shape, strides)?;
                self.push_node(Node::Tensor(tensor));
                Ok(())
            }
            _ => Err(self.error("a call with unexpected arguments")),
        }
    }

    fn tensor(
        &self,
        storage: Value<'a>,
        offset: Value<'a>,
        shape: Value<'a>,
        strides: Value<'a>,
    ) -> Result<Tensor<'a>, PthError> {
        let size = |value: &Value<'a>| match value {
            Value::Int(value) => usize::try_from(*value)
                .map_err(|error| self.error(format!("size or stride {value}: {error}"))),
            _ => Err(self.error("a size that is not an integer")),
        };
        let sizes = |value| self.tuple(value)?.iter().map(size).collect::<Result<Vec<_>, _>>();
        match storage {
            Value::Node(index) if let Node::Storage { dtype, bytes } = self.arena[index] => {
                Tensor::new(dtype, bytes, size(&offset)?, sizes(shape)?, sizes(strides)?)
            }
            _ => Err(self.error("a tensor without a storage")),
        }
    }

    fn integers(&self, root: Value<'a>) -> Integers {
        let Value::Node(index) = root else { return Integers::new() };
        let Node::Dict(items) = &self.arena[index] else { return Integers::new() };
        let named = |&(key, value): &(Value<'a>, Value<'a>)| match (key, value) {
            (Value::Text(name), Value::Int(value)) => Some((name.to_owned(), value)),
            (Value::Text(name), Value::Bool(value)) => Some((name.to_owned(), value.into())),
            _ => None,
        };
        items.iter().filter_map(named).collect()
    }

    fn root(self, root: Value<'a>) -> Result<Root<'a>, PthError> {
        let node = match root {
            Value::Node(index) => Some(&self.arena[index]),
            _ => None,
        };
        if let Some(Node::Tensor(tensor)) = node {
            return Ok(Root::Tensor(tensor.clone()));
        }
        let tensors = self.tensors(root)?;
        let found = match node {
            Some(Node::Dict(_)) => return Ok(Root::StateDict(tensors)),
            _ if !tensors.is_empty() => return Ok(Root::StateDict(tensors)),
            Some(Node::Object { class: (module, name), .. }) => {
                format!(
                    "an object of `{module}.{name}`, which is not part of a tensor file; refused"
                )
            }
            Some(Node::Tuple(values)) => {
                format!("a tuple of {} without tensors by name", values.len())
            }
            Some(Node::List(_)) => "a list".to_owned(),
            Some(Node::Storage { .. }) => "a bare storage".to_owned(),
            Some(Node::Tensor(_)) | None => "a single value".to_owned(),
        };
        Err(PthError::Root { found, expected: "tensors by name, or a tensor" })
    }

    /// Tensors by name, in file order, in dictionaries, tuples and
    /// objects; each container is visited once.
    fn tensors(&self, root: Value<'a>) -> Result<Vec<(String, Tensor<'a>)>, PthError> {
        // A name may be stored once and used often.
        let mut room = NAMES_FREE + NAMES_RATIO * self.bytes.len();
        let mut out = Vec::new();
        let mut seen = vec![false; self.arena.len()];
        let mut pending = vec![(String::new(), root, 0)];
        while let Some((path, value, depth)) = pending.pop() {
            let Value::Node(index) = value else { continue };
            let mut parts = Vec::new();
            match &self.arena[index] {
                Node::Tensor(tensor) => out.push((names::canonical(&path), tensor.clone())),
                Node::Storage { .. } | Node::List(_) => {}
                _ if std::mem::replace(&mut seen[index], true) => {}
                Node::Dict(items) => parts.extend(named(items)),
                Node::Object { state, items, .. } => {
                    parts.push((None, *state));
                    parts.extend(named(items));
                }
                Node::Tuple(values) => {
                    let indices = (0..values.len()).map(|index| Some(index.to_string().into()));
                    parts.extend(indices.zip(values.iter().copied()));
                }
            }
            for (name, value) in parts.into_iter().rev() {
                let path = names::joined(&path, name.as_deref());
                room = room.checked_sub(path.len()).ok_or_else(|| {
                    PthError::Tensor(
                        "its names are longer than plausible for a file of this size".to_owned(),
                    )
                })?;
                if depth < MAX_DEPTH {
                    pending.push((path, value, depth + 1));
                }
            }
        }
        Ok(out)
    }
}

/// Largest nesting depth that is searched for tensors; nested modules have about a dozen levels.
const MAX_DEPTH: usize = 64;
/// Limit on the total length of names, bytes: a constant, and a multiple of the pickle's length.
const NAMES_FREE: usize = 1 << 20;
const NAMES_RATIO: usize = 64;

/// Items whose key is a name.
fn named<'a, 'v>(
    items: &'v [(Value<'a>, Value<'a>)],
) -> impl Iterator<Item = (Option<Cow<'a, str>>, Value<'a>)> + 'v {
    items.iter().filter_map(|&(key, value)| match (key, value) {
        (Value::Text(name), Value::Node(_)) => Some((Some(Cow::Borrowed(name)), value)),
        _ => None,
    })
}

#[cfg(test)]
mod tests;
