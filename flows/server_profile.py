"""Say how a Prefect server is set up that one program starts for itself."""

from __future__ import annotations

_PATIENT = {
    "PREFECT_SERVER_DATABASE_TIMEOUT": "60",
    "PREFECT_SERVER_DATABASE_CONNECTION_TIMEOUT": "60",
}
SERVER_PROFILES: dict[str, dict[str, str]] = {
    "full": _PATIENT,
    "lean": _PATIENT
    | {
        "PREFECT_SERVER_SERVICES_EVENT_PERSISTER_ENABLED": "false",
        "PREFECT_SERVER_SERVICES_TRIGGERS_ENABLED": "false",
        "PREFECT_SERVER_UI_ENABLED": "false",
    },
}
"""Settings of a server. Both wait a minute for SQLite, which one writer locks: after the usual
ten seconds a busy server answers 503 and the scene fails. ``lean`` keeps no events and runs
no automations (so that runs of killed processes are not marked); flow runs and task runs are
recorded as ever.
"""
