"""What is wrong with a recording itself, before anything is explained from it."""

from endoscope_explain.audit.auditing import audit_recording
from endoscope_explain.audit.finding import AuditReport, Finding, Severity

__all__ = ['AuditReport', 'Finding', 'Severity', 'audit_recording']
