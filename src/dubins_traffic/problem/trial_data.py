"""The trial data file of 2016: the configuration and the instances of its trials, as valid JSON."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Annotated, Any

from pydantic import Field

from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import Configuration, plan_agents, settings_of
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.faults import Open, parse
from dubins_traffic.problem.files import FileKind, plain, read_source, write_document
from dubins_traffic.problem.instance import Instance

DATE_FORMAT = "%Y-%m-%d %H:%M:%S"
DATE_PATTERN = r"^\d{4}-\d{2}-\d{2} \d{2}:\d{2}:\d{2}$"


class TrialData(Open):
    """Trial data, version 0: as in 2016."""

    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    date: str = Field(pattern=DATE_PATTERN, description="when the trials began, YYYY-MM-DD HH:MM:SS, UTC")
    trialconf: dict[str, Any] = Field(description="the trials configuration")
    instances: list[dict[str, Any]] = Field(description="the problem instances, in the order of the trials")

    @staticmethod
    def build(configuration: Configuration, instances: Sequence[Instance], date: datetime) -> TrialData:
        """Return the data of trials: the configuration, with its network written in, and version 0 instances.

        Parameters
        ----------
        configuration : Configuration
            What the instances were drawn from.
        instances : sequence of Instance
            In the order of the trials.
        date : datetime
            When the trials began; naive is taken as UTC.
        """
        moment = date.astimezone(UTC) if date.tzinfo else date
        documents = [instance_to_document(instance, version=0) for instance in instances]
        return TrialData.of(moment.strftime(DATE_FORMAT), configuration.inlined(), documents)

    @staticmethod
    def of(date: str, trialconf: Mapping[str, Any], instances: Sequence[Mapping[str, Any]]) -> TrialData:
        """Return trial data of documents."""
        return TrialData(
            version=0,
            date=date,
            trialconf=dict(trialconf),
            instances=[dict(instance) for instance in instances],
        )

    @staticmethod
    def from_document(document: Mapping[str, Any], file: str | None = None) -> TrialData:
        """Return the checked trial data of a document.

        Its configuration and each of its instances are checked too. A road network that the configuration names by
        path is not looked up.

        Raises
        ------
        InputError
            For the first thing wrong, with its field.
        """
        data = parse(TrialData, plain(document, file), file=file)
        try:
            plan_agents(settings_of(data.trialconf).e_agents)
        except InputError as error:
            raise error.within(file=file, field="trialconf") from None
        for k, instance in enumerate(data.instances):
            try:
                instance_from_document(instance)
            except InputError as error:
                raise error.within(file=file, field=f"instances[{k}]") from None
        return data

    @staticmethod
    def read(source: str | os.PathLike[str]) -> TrialData:
        """Return the trial data in the file at `source` (``-``: standard input).

        Raises
        ------
        InputError
            If there is no such file, it holds something else, or something in it is wrong.
        """
        text = read_source(source)
        document = text.document(FileKind.TRIAL_DATA, "trial data", "version, date, trialconf, instances")
        return TrialData.from_document(document, text.name)

    def to_document(self) -> dict[str, Any]:
        """Return the document."""
        return self.model_dump()

    def write(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the file, as `write_document` does."""
        write_document(self.to_document(), path, overwrite=overwrite)
